// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/setting_judge.h"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <utility>

#include "core/random/counter_random.h"
#include "core/status/status_macros.h"
#include "render_worker/optical_planning/lens_image.h"
#include "render_worker/optics/parallel_rows.h"

namespace sightline {
namespace {

// A position farther than this many prior uncertainties from the line is another line.
constexpr double kReachDeviations = 3;
// From this f-number on speckle is as large as pixels, and every realisation counts.
constexpr double kFullRealisationsFNumber = 4;

PixelIrradiance WithPower(const PixelIrradiance& light, double factor) {
  PixelIrradiance scaled = light;
  for (float& value : scaled.laser_irradiance_w_m2.values) value *= static_cast<float>(factor);
  return scaled;
}

}  // namespace

struct SettingJudge::Images {
  double laser_power_w = 0;  // they were formed with
  std::vector<PixelIrradiance> realisations;
};

SettingJudge::SettingJudge(const Inspection& inspection, std::span<const ActiveEffect> effects,
                           std::vector<WeightedFrame> frames, uint64_t seed, RenderLimits limits)
    : inspection_(inspection),
      effects_(effects),
      planning_(inspection.optics.value()),
      frames_(std::move(frames)),
      seed_(seed),
      limits_(std::move(limits)) {}

SettingJudge::~SettingJudge() = default;

FrameSetup SettingJudge::Setup(size_t frame, const OpticalSetting& setting, int realisation) const {
  const FrameLight& light = *frames_[frame].light;
  PartFrameRequest request = light.request;
  request.setting = CameraSetting{setting.lens.f_number,          setting.exposure_time_s,
                                  setting.lens.focus_distance_m,  setting.laser_power_w,
                                  setting.lens.sensor_tilt_x_rad, setting.lens.sensor_tilt_y_rad};
  FrameSetup setup = PartFrameSetup(inspection_, request);
  // Never those of an image that `sightline render` makes.
  const auto r = static_cast<uint64_t>(realisation);
  setup.seeds.speckle = DeriveSeed(setup.seeds.speckle ^ seed_, "optics realisation", r);
  setup.seeds.noise = DeriveSeed(setup.seeds.noise ^ seed_, "optics realisation", r);
  setup.roi = light.grid.roi;
  return ApplyFrameEffects(setup, effects_);
}

absl::Status SettingJudge::LookThrough(const LensSetting& lens) {
  images_.clear();
  lens_ = lens;
  for (size_t f = 0; f < frames_.size(); ++f) {
    OpticalSetting setting;
    setting.lens = lens;
    setting.laser_power_w = inspection_.rig.laser.power_w;
    std::vector<uint64_t> seeds;
    for (int r = 0; r < Realisations(); ++r) {
      seeds.push_back(Setup(f, setting, r).seeds.speckle);
    }
    const FrameSetup setup = Setup(f, setting, 0);
    RenderLimits limits = limits_;
    if (limits_.progress) {
      limits.progress = [&](double fraction) {
        limits_.progress((static_cast<double>(f) + fraction) / static_cast<double>(frames_.size()));
      };
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto images,
                               ImageThroughLens(*frames_[f].light, setup, effects_, seeds, limits));
    images_.push_back(
        std::make_unique<Images>(Images{inspection_.rig.laser.power_w, std::move(images)}));
  }
  return absl::OkStatus();
}

const PixelIrradiance& SettingJudge::light(size_t frame) const {
  return images_[frame]->realisations[0];
}

int SettingJudge::Realisations() const {
  double some = planning_.realisations * std::min(lens_.f_number / kFullRealisationsFNumber, 1.0);
  // Other frames are other realisations, too.
  some /= static_cast<double>(frames_.size());
  return std::clamp(static_cast<int>(std::ceil(some)), 2, planning_.realisations);
}

double SettingJudge::ReachPx() const { return kReachDeviations * planning_.prior_uncertainty_px; }

absl::StatusOr<DetectedLine> SettingJudge::Detect(size_t frame, const OpticalSetting& setting,
                                                  int realisation, int exposure) const {
  const Images& images = *images_[frame];
  FrameSetup setup = Setup(frame, setting, realisation);
  if (exposure > 0) setup.seeds.noise = DeriveSeed(setup.seeds.noise, "second exposure");
  const PixelIrradiance& light = images.realisations[static_cast<size_t>(realisation)];
  // The scale of the filter follows the line's own distance.
  FrameSetup at_line = setup;
  at_line.plate.camera_distance_m = frames_[frame].light->median_line_depth_m;
  const DetectionPlan plan = PlanDetection(at_line, planning_.detector);
  if (setting.laser_power_w == images.laser_power_w || !(images.laser_power_w > 0)) {
    return ExposeAndDetect(light, setup, effects_, plan);
  }
  return ExposeAndDetect(WithPower(light, setting.laser_power_w / images.laser_power_w), setup,
                         effects_, plan);
}

JudgedSetting SettingJudge::Summarise(
    const OpticalSetting& setting,
    const std::vector<std::vector<std::vector<LineSums>>>& by_frame) const {
  // Blocks of columns of all frames, each with its realisations.
  std::vector<std::vector<LineSums>> blocks;
  std::vector<LineSums> frames;
  for (size_t f = 0; f < frames_.size(); ++f) {
    LineSums total;
    for (size_t b = 0; b < by_frame[f][0].size(); ++b) {
      std::vector<LineSums> realisations;
      for (const std::vector<LineSums>& r : by_frame[f]) {
        realisations.push_back(frames_[f].weight * r[b]);
        total += r[b];
      }
      blocks.push_back(std::move(realisations));
    }
    frames.push_back((1.0 / static_cast<double>(by_frame[f].size())) * total);
  }
  return {setting, std::move(frames),
          QualityEstimate(blocks, {planning_.prior_uncertainty_px, planning_.false_line_weight,
                                   planning_.max_clipped_fraction}),
          0};
}

absl::StatusOr<std::vector<JudgedSetting>> SettingJudge::Judge(
    std::span<const double> exposure_times_s, double laser_power_w) {
  std::vector<std::pair<double, double>> single;
  for (const double time_s : exposure_times_s) single.emplace_back(time_s, 0.0);
  return JudgePairs(single, laser_power_w);
}

absl::StatusOr<SettingJudge::BlockSums> SettingJudge::CountPairs(
    std::span<const std::pair<double, double>> long_and_short_s, double laser_power_w) {
  assert(images_.size() == frames_.size());
  const int realisations = Realisations();
  const int frames = static_cast<int>(frames_.size());
  const int pairs = static_cast<int>(long_and_short_s.size());
  BlockSums sums(static_cast<size_t>(pairs),
                 std::vector<std::vector<std::vector<LineSums>>>(
                     static_cast<size_t>(frames),
                     std::vector<std::vector<LineSums>>(static_cast<size_t>(realisations))));
  const int tasks = pairs * frames * realisations;
  std::vector<absl::Status> statuses(static_cast<size_t>(tasks));
  std::atomic<int> done = 0;
  // Neighbouring tasks cost about the same: dealt out in turn.
  const int threads = std::max(1, limits_.threads);
  ForIndexRanges(threads, threads, [&](int begin, int end) {
    for (int thread = begin; thread < end; ++thread) {
      for (int task = thread; task < tasks; task += threads) {
        if (limits_.cancelled != nullptr && *limits_.cancelled) return;
        const auto pair = static_cast<size_t>(task / (frames * realisations));
        const auto frame = static_cast<size_t>(task / realisations % frames);
        const int r = task % realisations;
        OpticalSetting setting{lens_, long_and_short_s[pair].first, 0, laser_power_w};
        auto detected = Detect(frame, setting, r, 0);
        if (detected.ok() && long_and_short_s[pair].second > 0) {
          setting.exposure_time_s = long_and_short_s[pair].second;
          const auto second = Detect(frame, setting, r, 1);
          if (second.ok()) {
            *detected = MergeExposures(*detected, *second, ReachPx());
          } else {
            detected = second.status();
          }
        }
        if (!detected.ok()) {
          statuses[static_cast<size_t>(task)] = detected.status();
          continue;
        }
        const FrameLight& light = *frames_[frame].light;
        const FrameSetup setup = Setup(frame, setting, r);
        sums[pair][frame][static_cast<size_t>(r)] =
            JudgeLine(*detected, PlanDetection(setup, planning_.detector), light.line,
                      light.grid.roi.columns_px, ReachPx());
        ++done;
        // One thread speaks for all.
        if (thread == 0 && limits_.progress) {
          limits_.progress(static_cast<double>(done) / tasks);
        }
      }
    }
  });
  if (limits_.cancelled != nullptr && *limits_.cancelled) return absl::CancelledError("cancelled");
  for (const absl::Status& status : statuses) {
    if (!status.ok()) return status;
  }
  judged_images_ += tasks;
  return sums;
}

absl::StatusOr<std::vector<JudgedSetting>> SettingJudge::JudgePairs(
    std::span<const std::pair<double, double>> long_and_short_s, double laser_power_w) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto sums, CountPairs(long_and_short_s, laser_power_w));
  std::vector<JudgedSetting> judged;
  for (size_t pair = 0; pair < long_and_short_s.size(); ++pair) {
    const auto& [long_s, short_s] = long_and_short_s[pair];
    judged.push_back(Summarise({lens_, long_s, short_s, laser_power_w}, sums[pair]));
  }
  return judged;
}

absl::StatusOr<std::vector<DetectedBlock>> SettingJudge::DetectedBlocks(
    const OpticalSetting& setting) {
  const std::vector<std::pair<double, double>> exposures = {
      {setting.exposure_time_s, setting.second_exposure_time_s}};
  SIGHTLINE_ASSIGN_OR_RETURN(const auto sums, CountPairs(exposures, setting.laser_power_w));
  std::vector<DetectedBlock> detected;
  for (size_t f = 0; f < frames_.size(); ++f) {
    const FrameLight& light = *frames_[f].light;
    const DetectionPlan plan = PlanDetection(Setup(f, setting, 0), planning_.detector);
    const auto blocks = CrossingsOfBlocks(plan, light.line, light.grid.roi.columns_px);
    for (size_t b = 0; b < blocks.size(); ++b) {
      if (blocks[b].empty()) continue;
      DetectedBlock block;
      for (const size_t crossing : blocks[b]) {
        block.distance_m += light.line_views[crossing].distance_m;
        block.incidence_rad += light.line_views[crossing].incidence_rad;
      }
      block.distance_m /= static_cast<double>(blocks[b].size());
      block.incidence_rad /= static_cast<double>(blocks[b].size());
      for (const std::vector<LineSums>& realisation : sums[0][f]) {
        block.crossings += realisation[b].crossings;
        block.found += realisation[b].found;
        block.deviation_px += realisation[b].deviation_px;
        block.deviation2_px2 += realisation[b].deviation2_px2;
      }
      detected.push_back(block);
    }
  }
  return detected;
}

}  // namespace sightline
