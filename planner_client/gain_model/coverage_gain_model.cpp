// SPDX-License-Identifier: Apache-2.0
#include "planner_client/gain_model/coverage_gain_model.h"

#include "core/status/status_macros.h"

namespace sightline {

const TargetBits& CoverageGainModel::validation_measurable() const {
  return fresh_ != nullptr ? fresh_->measurable() : GainModel::validation_measurable();
}

absl::StatusOr<std::vector<ScanGain>> CoverageGainModel::Gains(
    std::span<const Measurement> measurements, std::span<const float> known) {
  return client_.Gains(measurements, known);
}

absl::StatusOr<std::vector<ScanGain>> CoverageGainModel::WeightedGains(
    std::span<const Measurement> measurements, std::span<const float> weights) {
  return client_.WeightedGains(measurements, weights);
}

absl::StatusOr<std::vector<ScanCoverage>> CoverageGainModel::FastCoverage(
    std::span<const Measurement> measurements) {
  return client_.FastCoverage(measurements);
}

absl::StatusOr<std::vector<ScanCoverage>> CoverageGainModel::ExactCoverage(
    std::span<const Measurement> measurements) {
  auto coverages = client_.ExactCoverage(measurements);
  if (!coverages.ok() || fresh_ == nullptr) return coverages;
  SIGHTLINE_ASSIGN_OR_RETURN(auto fresh, fresh_->ExactCoverage(measurements));
  for (size_t i = 0; i < coverages->size(); ++i) {
    (*coverages)[i].validation_covered = std::move(fresh[i].covered);
  }
  return coverages;
}

}  // namespace sightline
