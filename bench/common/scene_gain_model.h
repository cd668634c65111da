// SPDX-License-Identifier: Apache-2.0
// A coverage scene in this process as what planners ask, without a server between.
#pragma once

#include "coverage_server/scene/coverage_scene.h"
#include "planning/strategy/gain_model.h"

namespace sightline::bench {

class SceneGainModel final : public GainModel {
 public:
  explicit SceneGainModel(const CoverageScene& scene) : scene_(scene) {}

  const TargetBits& measurable() const override { return scene_.measurable(); }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override;
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override;
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override;
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override;
  int64_t evaluations() const override { return evaluations_; }

 private:
  std::vector<ScanGain> GainsOf(std::span<const Measurement> measurements,
                                const TargetBits* covered, std::span<const float> weights);

  const CoverageScene& scene_;
  int64_t evaluations_ = 0;
};

}  // namespace sightline::bench
