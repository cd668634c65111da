// SPDX-License-Identifier: Apache-2.0
// Gain model for uncertainty, which queries a coverage server. A target is satisfied when its
// uncertainty is admissible (thesis eq. 3.2). A scan's fraction is its information divided by the
// information that this requires.
#pragma once

#include <array>
#include <map>
#include <vector>

#include "planner_client/coverage_client/coverage_client.h"

namespace sightline {

// Required uncertainty of the targets of one sampling.
struct TolerancedTargets {
  TargetBits bits;                              // measurable, and a tolerance binds them
  std::vector<float> admissible_uncertainty_m;  // 0: not toleranced
  // Information density [1/m^4] at which the uncertainty is admissible, and at which it is relaxed;
  // infinite if a target is not toleranced.
  std::vector<float> admissible_density;
  std::vector<float> relaxed_density;
};

// `admissible_uncertainty_m`: one per target of the client's scene. A target whose admissible
// uncertainty is not below the prior one requires no information.
TolerancedTargets FindTolerancedTargets(const CoverageClient& client, const UncertaintyModel& model,
                                        const TargetSampling& sampling,
                                        std::vector<float> admissible_uncertainty_m,
                                        double relaxed_uncertainty_m);

class UncertaintyGainModel final : public GainModel {
 public:
  struct Sampling {
    CoverageClient* client;
    TolerancedTargets targets;
  };
  // `fresh.client` may be null. Clients must outlive the gain model.
  UncertaintyGainModel(Sampling planned, Sampling fresh, const UncertaintyModel& model,
                       const GainWeights& weights, double relaxed_uncertainty_m);

  absl::Status SetWeights(const GainWeights& weights) override {
    query_.weights = weights;
    return absl::OkStatus();
  }

  const TargetBits& measurable() const override { return planned_.targets.bits; }
  const TargetBits& validation_measurable() const override { return fresh_.targets.bits; }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override;
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override;
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override;
  // Coverage, for a scan's travel and its feasibility.
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override;
  int64_t evaluations() const override { return planned_.client->evaluations(); }

  std::vector<ShareStep> steps() const override;
  bool ScoresPlans() const override { return true; }
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> scans, bool thorough) override;
  absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> scans) override;

 private:
  struct Counts {
    int64_t satisfied = 0, relaxed = 0;
  };
  // Exact counts over all toleranced targets, or estimates from a subset.
  absl::StatusOr<Counts> Count(const Sampling& sampling, std::span<const Measurement> scans,
                               bool thorough) const;

  Sampling planned_, fresh_;
  UncertaintyQuery query_;
  double prior_standard_deviation_m_;
};

}  // namespace sightline
