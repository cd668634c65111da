// SPDX-License-Identifier: Apache-2.0
#include "render_worker/verification/verify.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/parallel/exception_status.h"
#include "core/statistics/order_statistics.h"
#include "core/status/status_macros.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/image_file/grey_png.h"
#include "render_worker/recordings/plate_frames.h"
#include "render_worker/sensor/expose.h"
#include "render_worker/verification/line_statistics.h"

namespace sightline {
namespace {

constexpr int kCropColumnsPx = 256;
constexpr int kCropRowsPx = 96;

// Part of `image` of at most the crop's size, about a row.
Image<float> Crop(const Image<float>& image, double centre_row) {
  const int columns = std::min(kCropColumnsPx, image.columns_px);
  const int rows = std::min(kCropRowsPx, image.rows_px);
  const int left = (image.columns_px - columns) / 2;
  const int top = std::clamp(static_cast<int>(centre_row) - rows / 2, 0, image.rows_px - rows);
  Image<float> crop(columns, rows);
  for (int row = 0; row < rows; ++row) {
    std::copy_n(image.Row(top + row) + left, columns, crop.Row(row));
  }
  return crop;
}

// Grey with `black_dn` as black and `white_dn` as white.
absl::StatusOr<std::string> ScaledPng(const Image<float>& image, double black_dn, double white_dn) {
  Image<uint8_t> grey(image.columns_px, image.rows_px);
  for (size_t i = 0; i < image.values.size(); ++i) {
    const double share = (image.values[i] - black_dn) / std::max(1.0, white_dn - black_dn);
    grey.values[i] = static_cast<uint8_t>(std::lround(255 * std::clamp(share, 0.0, 1.0)));
  }
  return EncodeGreyPng(grey);
}

// Value that all but a thousandth stay below: single bright speckles may burn out.
double Brightest(const Image<float>& image) {
  return OrderStatistic(image.values, image.values.size() * 999 / 1000);
}

absl::Status AddCrops(const Image<uint16_t>& recorded, const Image<uint16_t>& simulated,
                      const ColourChannel& channel, double line_row_px, const FrameSetup& frame,
                      v1::RecordingVerification* result) {
  const PixelPlane& plane = channel.planes.front();
  const double row = (line_row_px - plane.first_row) / plane.step;
  const Image<float> left = Crop(PlaneValues(recorded, plane), row);
  const Image<float> right = Crop(PlaneValues(simulated, plane), row);
  const Sensor& sensor = frame.sensor;
  const double black_dn = DarkMeanDn(sensor);
  const double white_dn = std::max(Brightest(left), Brightest(right));
  SIGHTLINE_ASSIGN_OR_RETURN(std::string left_png, ScaledPng(left, black_dn, white_dn));
  SIGHTLINE_ASSIGN_OR_RETURN(std::string right_png, ScaledPng(right, black_dn, white_dn));
  result->set_recorded_crop_png(std::move(left_png));
  result->set_simulated_crop_png(std::move(right_png));
  return absl::OkStatus();
}

absl::StatusOr<v1::ChannelVerification> CompareChannel(const Image<uint16_t>& recorded,
                                                       const Image<uint16_t>& simulated,
                                                       const ColourChannel& channel,
                                                       const FrameSetup& frame) {
  v1::ChannelVerification result;
  result.set_channel(channel.name);
  const AverageProfile real = AverageAlongLine(recorded, channel);
  const AverageProfile model = AverageAlongLine(simulated, channel);
  for (size_t i = 0; i < real.row_px.size(); ++i) {
    result.add_row_px(real.row_px[i]);
    result.add_recorded_dn(real.mean_dn[i]);
    result.add_simulated_dn(model.mean_dn[i]);
  }
  if (real.Peak() > 0) result.set_e_i((real.Peak() - model.Peak()) / real.Peak());

  SIGHTLINE_ASSIGN_OR_RETURN(const auto real_line, DetectLineScatter(recorded, channel, frame));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto model_line, DetectLineScatter(simulated, channel, frame));
  result.set_recorded_found_fraction(real_line.found_fraction);
  result.set_simulated_found_fraction(model_line.found_fraction);
  if (real_line.found()) {
    result.set_recorded_u_px(real_line.u_px);
    result.set_recorded_u_h_m(HeightUncertainty(real_line.u_px, frame));
  }
  if (model_line.found()) {
    result.set_simulated_u_px(model_line.u_px);
    result.set_simulated_u_h_m(HeightUncertainty(model_line.u_px, frame));
  }
  if (real_line.found() && model_line.found() && real_line.u_px > 0) {
    result.set_e_u((real_line.u_px - model_line.u_px) / real_line.u_px);
  }
  return result;
}

absl::StatusOr<v1::RecordingVerification> VerifyRecording(const RecordedSet& set, int index,
                                                          uint64_t seed) {
  PlateFrameOptions options;
  options.seed = seed;
  const FrameSetup frame = PlateFrame(set.description, index, options);
  // Without effects nothing remains of the frame before, so the order of a burst does not matter.
  SIGHTLINE_ASSIGN_OR_RETURN(const auto simulated, RenderPlateFrame(frame, {}, nullptr, 1));

  const RecordedImage& image = set.description.recordings[index];
  const Image<uint16_t>& recorded = set.frames[index].raw_dn;
  v1::RecordingVerification result;
  result.set_recording(index);
  result.set_file(image.file);
  result.set_camera_distance_m(image.camera_distance_m);
  result.set_focus_distance_m(image.focus_distance_m);
  result.set_f_number(image.f_number);
  result.set_exposure_time_s(image.exposure_time_s);
  result.set_normalised_exposure(image.exposure_time_s * std::pow(22 / image.f_number, 2));
  const std::vector<ColourChannel> channels = ColourChannels(frame.sensor);
  int brightest = 0;
  double brightest_dn = 0, line_row_px = 0;
  for (size_t c = 0; c < channels.size(); ++c) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto compared,
                               CompareChannel(recorded, simulated.raw_dn, channels[c], frame));
    const AverageProfile model = AverageAlongLine(simulated.raw_dn, channels[c]);
    if (model.Peak() > brightest_dn) {
      brightest = static_cast<int>(c);
      brightest_dn = model.Peak();
      line_row_px = model.row_px[std::max_element(model.mean_dn.begin(), model.mean_dn.end()) -
                                 model.mean_dn.begin()];
    }
    *result.add_channels() = std::move(compared);
  }
  SIGHTLINE_RETURN_IF_ERROR(
      AddCrops(recorded, simulated.raw_dn, channels[brightest], line_row_px, frame, &result));
  return result;
}

// Statistics of one relative error over the recordings.
struct ErrorStatistics {
  int count = 0;
  double sum = 0, squares = 0, largest = 0;

  void Add(double error) {
    ++count;
    sum += error;
    squares += error * error;
    if (std::abs(error) > std::abs(largest)) largest = error;
  }
  double Mean() const { return sum / count; }
  double Deviation() const {
    return std::sqrt(std::max(0.0, (squares - sum * Mean()) / (count - 1)));
  }
};

v1::ChannelSummary Summarise(const v1::Verification& verification, int channel) {
  ErrorStatistics intensity, scatter;
  v1::ChannelSummary summary;
  for (const v1::RecordingVerification& recording : verification.recordings()) {
    const v1::ChannelVerification& compared = recording.channels(channel);
    summary.set_channel(compared.channel());
    if (compared.has_e_i()) intensity.Add(compared.e_i());
    if (compared.has_e_u()) scatter.Add(compared.e_u());
  }
  summary.set_recordings_e_i(intensity.count);
  summary.set_recordings_e_u(scatter.count);
  if (intensity.count > 0) {
    summary.set_mean_e_i(intensity.Mean());
    summary.set_largest_e_i(intensity.largest);
  }
  if (scatter.count > 0) {
    summary.set_mean_e_u(scatter.Mean());
    summary.set_largest_e_u(scatter.largest);
  }
  if (intensity.count > 1) summary.set_deviation_e_i(intensity.Deviation());
  if (scatter.count > 1) summary.set_deviation_e_u(scatter.Deviation());
  return summary;
}

void AddWarnings(v1::Verification* verification) {
  for (const v1::RecordingVerification& recording : verification->recordings()) {
    for (const v1::ChannelVerification& channel : recording.channels()) {
      std::string where;
      if (!channel.has_recorded_u_px()) where = "recorded";
      if (!channel.has_simulated_u_px()) where += where.empty() ? "simulated" : " and simulated";
      if (where.empty()) continue;
      verification->add_warnings(absl::StrCat(recording.file(), ": ", channel.channel(),
                                              ": no line to detect in the ", where,
                                              " image, so it says nothing about u"));
    }
  }
}

}  // namespace

absl::StatusOr<v1::Verification> Verify(const RecordedSet& set,
                                        const VerificationSettings& settings,
                                        const DiagnosisProgress& progress) {
  std::vector<int> lasers;
  for (size_t i = 0; i < set.frames.size(); ++i) {
    if (set.description.recordings[i].kind != RecordingKind::kLaser) continue;
    if (set.frames[i].raw_dn.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat(set.description.recordings[i].file, ": there is no image to verify"));
    }
    lasers.push_back(static_cast<int>(i));
  }
  if (lasers.empty()) {
    return absl::FailedPreconditionError(
        "recordings: none is of kind \"laser\", so there is no line to verify");
  }

  const int count = static_cast<int>(lasers.size());
  std::vector<absl::StatusOr<v1::RecordingVerification>> results(lasers.size(),
                                                                 absl::CancelledError("cancelled"));
  std::atomic<int> next = 0, done = 0;
  std::atomic<bool> cancelled = false;
  std::mutex mutex;
  std::condition_variable finished;
  const auto work = [&] {
    for (int i = next++; i < count && !cancelled; i = next++) {
      try {
        results[i] = VerifyRecording(set, lasers[i], settings.seed);
      } catch (...) {
        results[i] = StatusOfException();
      }
      const std::lock_guard lock(mutex);
      ++done;
      finished.notify_one();
    }
  };
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < std::clamp(settings.threads, 1, count); ++t) threads.emplace_back(work);
    int told = -1;
    while (done < count && !cancelled) {
      if (done != told) {
        told = done;
        if (progress && !progress(static_cast<double>(told) / count,
                                  absl::StrCat("image ", told + 1, " of ", count))) {
          cancelled = true;
          break;
        }
      }
      std::unique_lock lock(mutex);
      // Wakes up periodically to check for cancellation.
      if (!finished.wait_for(lock, std::chrono::milliseconds(100), [&] { return done != told; })) {
        told = -1;
      }
    }
  }
  if (cancelled) return absl::CancelledError("cancelled");

  v1::Verification verification;
  verification.set_set(set.description.name);
  verification.set_seed(static_cast<int64_t>(settings.seed));
  for (absl::StatusOr<v1::RecordingVerification>& result : results) {
    if (!result.ok()) return result.status();
    *verification.add_recordings() = *std::move(result);
  }
  for (int c = 0; c < verification.recordings(0).channels_size(); ++c) {
    *verification.add_summary() = Summarise(verification, c);
  }
  AddWarnings(&verification);
  return verification;
}

}  // namespace sightline
