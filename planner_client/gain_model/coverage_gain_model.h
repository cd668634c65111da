// SPDX-License-Identifier: Apache-2.0
// Gain model for coverage: queries a coverage server and also scores validation targets.
#pragma once

#include "planner_client/coverage_client/coverage_client.h"

namespace sightline {

class CoverageGainModel final : public GainModel {
 public:
  // `fresh`: the same task with validation targets; may be null. Both must outlive the gain model.
  CoverageGainModel(CoverageClient& client, CoverageClient* fresh)
      : client_(client), fresh_(fresh) {}

  const TargetBits& measurable() const override { return client_.measurable(); }
  const TargetBits& validation_measurable() const override;
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override;
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override;
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override;
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override;
  int64_t evaluations() const override { return client_.evaluations(); }

 private:
  CoverageClient& client_;
  CoverageClient* fresh_;
};

}  // namespace sightline
