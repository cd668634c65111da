// SPDX-License-Identifier: Apache-2.0
// Evaluates camera settings by simulated images of a group of frames.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/optics_planning.h"
#include "core/laser_line/line_quality.h"
#include "render_worker/optical_planning/detection_noise.h"
#include "render_worker/optical_planning/frame_light.h"
#include "render_worker/optical_planning/line_evaluation.h"

namespace sightline {

// Adjustable values of the lens.
struct LensSetting {
  double f_number = 0;
  double focus_distance_m = 0;
  double sensor_tilt_x_rad = 0, sensor_tilt_y_rad = 0;

  auto operator<=>(const LensSetting&) const = default;
};

struct OpticalSetting {
  LensSetting lens;
  double exposure_time_s = 0;
  double second_exposure_time_s = 0;  // 0: none
  double laser_power_w = 0;
};

struct JudgedSetting {
  OpticalSetting setting;
  std::vector<LineSums> frames;  // by frame, averaged over its realisations, unweighted
  QualityEstimate quality;
  double time_cost_px = 0;  // cost of scanning time, in addition to quality.mean().cost

  double cost() const { return quality.mean().cost + time_cost_px; }
};

// A frame that represents a share of a scan's line.
struct WeightedFrame {
  std::shared_ptr<const FrameLight> light;
  double weight = 1;
};

class SettingJudge {
 public:
  // `inspection` and `effects` must outlive this object. The light of the frames must be traced
  // with the inspection. ReportTo sets the progress callback of `limits`.
  SettingJudge(const Inspection& inspection, std::span<const ActiveEffect> effects,
               std::vector<WeightedFrame> frames, uint64_t seed, RenderLimits limits);
  ~SettingJudge();

  // While LookThrough, Judge or JudgePairs works, `report` gets the fraction done in [0, 1], from
  // one thread at a time; may be empty.
  void ReportTo(std::function<void(double)> report) { limits_.progress = std::move(report); }

  // Applies the lens setting: images all frames and realisations through it. The images of the
  // previous setting are dropped. Errors of ImageThroughLens.
  absl::Status LookThrough(const LensSetting& lens);

  // Evaluates exposure times, in their order, with that lens setting at a laser power. CANCELLED.
  absl::StatusOr<std::vector<JudgedSetting>> Judge(std::span<const double> exposure_times_s,
                                                   double laser_power_w);

  // The same with two exposures per frame, (long, short); a short one of 0 means none.
  absl::StatusOr<std::vector<JudgedSetting>> JudgePairs(
      std::span<const std::pair<double, double>> long_and_short_s, double laser_power_w);

  // Detections with one setting in all blocks of all frames that have a crossing. The lens setting
  // must be that of the last LookThrough. CANCELLED.
  absl::StatusOr<std::vector<DetectedBlock>> DetectedBlocks(const OpticalSetting& setting);

  // The frame's setup for a setting and a realisation; the plate's distance is that of its line.
  FrameSetup Setup(size_t frame, const OpticalSetting& setting, int realisation) const;
  const std::vector<WeightedFrame>& frames() const { return frames_; }
  // Light of the first realisation of a frame with the lens setting of the last LookThrough.
  const PixelIrradiance& light(size_t frame) const;
  // Images evaluated so far.
  int64_t judged_images() const { return judged_images_; }

 private:
  struct Images;  // of one frame: one per realisation

  // `exposure`: 0, or 1 for the second exposure of a frame, which has other photons.
  absl::StatusOr<DetectedLine> Detect(size_t frame, const OpticalSetting& setting, int realisation,
                                      int exposure) const;
  // Sums of every pair of exposures: [pair][frame][realisation][block].
  using BlockSums = std::vector<std::vector<std::vector<std::vector<LineSums>>>>;
  absl::StatusOr<BlockSums> CountPairs(std::span<const std::pair<double, double>> long_and_short_s,
                                       double laser_power_w);
  JudgedSetting Summarise(const OpticalSetting& setting,
                          const std::vector<std::vector<std::vector<LineSums>>>& by_frame) const;
  double ReachPx() const;
  // Number of realisations for the lens setting of the last LookThrough: fewer for a wide pupil.
  int Realisations() const;

  const Inspection& inspection_;
  std::span<const ActiveEffect> effects_;
  const OpticsPlanning planning_;
  std::vector<WeightedFrame> frames_;
  uint64_t seed_;
  RenderLimits limits_;
  LensSetting lens_;
  std::vector<std::unique_ptr<Images>> images_;
  int64_t judged_images_ = 0;
};

}  // namespace sightline
