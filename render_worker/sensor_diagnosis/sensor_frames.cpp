// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/sensor_frames.h"

#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "core/recordings/raw_numbers.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Checks an image and counts its raw numbers.
absl::Status CountRawNumbers(const v1::SensorSet& set, const std::string& file,
                             const Image<uint16_t>& image, int largest,
                             std::vector<int64_t>* counts) {
  if (image.columns_px != set.columns_px() || image.rows_px != set.rows_px()) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s: has %d x %d pixels, the set's description says %d x %d", file,
                        image.columns_px, image.rows_px, set.columns_px(), set.rows_px()));
  }
  for (const uint16_t value : image.values) {
    if (value > largest) {
      return absl::InvalidArgumentError(absl::StrFormat(
          "%s: has the value %d, which %d bits cannot hold (at most %d); numbers must not be "
          "shifted to the upper bits",
          file, value, set.bit_depth_bit(), largest));
    }
    ++(*counts)[value];
  }
  return absl::OkStatus();
}

// A camera may clip below 2^bits - 1: clipped pixels are then those at its own limit.
void FindClippedPixels(const std::vector<int64_t>& counts, int largest,
                       std::vector<FlatFieldStatistics>* steps) {
  const int limit = UpperLimit(counts, largest);
  for (FlatFieldStatistics& step : *steps) {
    if (limit < largest && step.largest_seen_dn == limit) {
      step.share_at_largest = step.share_at_largest_seen;
    }
  }
}

}  // namespace

absl::StatusOr<SensorSetStatistics> ReadSensorFrames(const v1::SensorSet& set,
                                                     const SensorDiagnosisHooks& hooks) {
  SensorSetStatistics result;
  const int largest = (1 << set.bit_depth_bit()) - 1;
  int64_t images = 0, read = 0;
  for (const v1::FlatFieldStep& step : set.steps()) images += step.files_size();
  for (const v1::FlatFieldStep& step : set.steps()) {
    FlatFieldAccumulator frames(largest, step.files_size() >= kFewestFramesOfPattern);
    for (const std::string& file : step.files()) {
      if (hooks.cancelled != nullptr && hooks.cancelled->load()) {
        return absl::CancelledError("cancelled");
      }
      SIGHTLINE_ASSIGN_OR_RETURN(const auto image, hooks.read_image(file));
      SIGHTLINE_RETURN_IF_ERROR(CountRawNumbers(set, file, image, largest, &result.counts));
      frames.Add(image);
      ++read;
      if (!hooks.on_progress) continue;
      hooks.on_progress(kReadingShare * static_cast<double>(read) / static_cast<double>(images),
                        "reading frames");
    }
    FlatFieldStatistics statistics = frames.Finish();
    statistics.dark = step.dark();
    statistics.exposure_time_s = step.exposure_time_s();
    if (step.has_photons() && !step.dark()) statistics.photons = step.photons();
    result.steps.push_back(std::move(statistics));
  }
  FindClippedPixels(result.counts, largest, &result.steps);
  return result;
}

FlatFieldSteps::FlatFieldSteps(std::span<const FlatFieldStatistics> steps) : all(steps) {
  for (const FlatFieldStatistics& step : steps) (step.dark ? dark : bright).push_back(&step);
}

const FlatFieldStatistics* FlatFieldSteps::NearestDark(double exposure_time_s) const {
  const FlatFieldStatistics* nearest = nullptr;
  for (const FlatFieldStatistics* step : dark) {
    if (!nearest || std::abs(step->exposure_time_s - exposure_time_s) <
                        std::abs(nearest->exposure_time_s - exposure_time_s)) {
      nearest = step;
    }
  }
  return nearest;
}

double FlatFieldSteps::DarkMeanDn(double exposure_time_s) const {
  const FlatFieldStatistics* nearest = NearestDark(exposure_time_s);
  return nearest ? nearest->MeanDn() : 0;
}

double FlatFieldSteps::SignalDn(const FlatFieldStatistics& step) const {
  return step.dark ? 0 : step.MeanDn() - DarkMeanDn(step.exposure_time_s);
}

}  // namespace sightline
