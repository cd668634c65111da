// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/next_recording.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {

namespace {

std::string NameOf(const Hypothesis& hypothesis) {
  if (hypothesis.effects.empty()) return "none";
  return std::string(hypothesis.effects.front().effect->description().id);
}

// Variants of one recording of the set, each at a plate position of its own.
std::vector<RecordedImage> Variants(const RecordingSet& set) {
  std::vector<RecordedImage> variants;
  const auto laser =
      std::find_if(set.recordings.begin(), set.recordings.end(),
                   [](const RecordedImage& image) { return image.kind == RecordingKind::kLaser; });
  if (laser == set.recordings.end()) return variants;
  const RecordedImage& reference = *laser;
  const auto add = [&](auto change) {
    RecordedImage image = reference;
    image.timestamp_s = set.recordings.back().timestamp_s + 30;
    image.burst_frame_index = 0;
    image.same_speckle = false;
    change(image);
    variants.push_back(image);
  };
  // Another f-number gets the exposure that keeps the line in focus as bright as in the reference.
  for (double f_number : {2.0, 4.0, 8.0, 16.0}) {
    add([&](RecordedImage& image) {
      image.f_number = f_number;
      image.exposure_time_s *= std::pow(f_number / reference.f_number, 2);
    });
  }
  for (double factor : {0.1, 4.0, 16.0}) {
    add([&](RecordedImage& image) { image.exposure_time_s *= factor; });
  }
  for (double factor : {0.7, 1.4}) {
    add([&](RecordedImage& image) { image.camera_distance_m *= factor; });
    add([&](RecordedImage& image) { image.laser_distance_m *= factor; });
  }
  add([&](RecordedImage& image) { image.focus_distance_m *= 1.3; });
  add([&](RecordedImage& image) {
    image.roi_column_px = set.camera.columns_px / 2 - image.roi_columns_px - 8;
  });
  for (double exposure_s : {1e-4, 0.5}) {
    add([&](RecordedImage& image) {
      image.kind = RecordingKind::kDark;
      image.plate_position_id.reset();
      image.exposure_time_s = exposure_s;
    });
  }
  return variants;
}

}  // namespace

std::vector<v1::NextRecording> NextRecordings(const RecordedSet& set, const Hypothesis& a,
                                              const Hypothesis& b, int count) {
  RecordingSet planned = set.description;
  planned.recordings = Variants(set.description);
  if (planned.recordings.empty()) return {};
  for (size_t i = 0; i < planned.recordings.size(); ++i) {
    RecordedImage& image = planned.recordings[i];
    image.repeat_group = static_cast<int>(i);
    if (image.plate_position_id) image.plate_position_id = static_cast<int>(i) + 1;
  }
  const RecordedSet future = MakeRecordedSet(planned, {});
  const SetModel model(future, {});
  SetParameters first = a.fit.parameters, second = b.fit.parameters;
  first.line_shift_px.clear();
  second.line_shift_px.clear();
  const SetModel::Expectation expected = model.Expect(first, true);
  const BlockVectors other = model.Expect(second, false).mean;
  const Whitening whitening(expected.covariance, {});
  std::vector<double> distance(planned.recordings.size(), 0);
  for (int e = 0; e < model.blocks(); ++e) {
    if (model.FramesOf(e).size() != 1) continue;
    distance[model.FramesOf(e).front()] += whitening(e, other[e] - expected.mean[e]).squaredNorm();
  }
  const double p = a.probability / std::max(1e-12, a.probability + b.probability);
  const double entropy = p <= 0 || p >= 1 ? 0 : -(p * std::log2(p) + (1 - p) * std::log2(1 - p));
  std::vector<v1::NextRecording> best;
  for (size_t i = 0; i < planned.recordings.size(); ++i) {
    // Bhattacharyya's coefficient of two normal distributions: exp(-d^2 / 8).
    const double gain = entropy * (1 - std::exp(-distance[i] / 8));
    if (!(gain > thresholds::kWorthARecording_bits)) continue;
    const RecordedImage& image = planned.recordings[i];
    v1::NextRecording next;
    RecordingSet one = planned;
    one.recordings = {image};
    *next.mutable_recording() = RecordingsToProto(one).recordings(0);
    next.mutable_recording()->clear_file();
    if (!image.plate_position_id) next.mutable_recording()->clear_plate_position_id();
    next.set_description(
        image.kind == RecordingKind::kDark
            ? absl::StrFormat("dark frame, %.3g ms", 1e3 * image.exposure_time_s)
            : absl::StrFormat(
                  "f/%.3g, %.3g ms, camera %.0f mm, focused on %.0f mm, laser %.0f mm%s",
                  image.f_number, 1e3 * image.exposure_time_s, 1e3 * image.camera_distance_m,
                  1e3 * image.focus_distance_m, 1e3 * image.laser_distance_m,
                  image.roi_column_px != planned.recordings[0].roi_column_px
                      ? ", at the edge of the sensor"
                      : ""));
    next.set_expected_gain_bits(gain);
    next.add_tells_apart(NameOf(a));
    next.add_tells_apart(NameOf(b));
    best.push_back(std::move(next));
  }
  std::stable_sort(best.begin(), best.end(), [](const auto& x, const auto& y) {
    return x.expected_gain_bits() > y.expected_gain_bits();
  });
  if (static_cast<int>(best.size()) > count) best.resize(count);
  return best;
}

}  // namespace sightline
