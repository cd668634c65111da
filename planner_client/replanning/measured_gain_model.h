// SPDX-License-Identifier: Apache-2.0
// Gain model for plans whose first scans have been measured: their points determine the targets
// that these satisfy. Other scans are simulated on the part as measured.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/registration/surface_deviation.h"
#include "planner_client/gain_model/uncertainty_gain_model.h"
#include "planning/strategy/gain_model.h"

namespace sightline {

// Information of measured points about the targets of one sampling.
struct MeasuredTargets {
  std::vector<TargetBits> covered;  // one per measured scan; measurable targets only
  std::vector<int64_t> points;      // one per measured scan
  // Only of plans for uncertainty.
  CoverageClient* client = nullptr;  // must outlive the gain model
  TolerancedTargets toleranced;
  std::vector<SurfacePrior> priors;  // one per target
  PointUncertainties uncertainties;
};

class MeasuredGainModel final : public GainModel {
 public:
  // `scans`: the measured scans as in the plan. `planned`, `fresh`: information of their points
  // about the targets of `gain_model`; `fresh` is unset if that has no validation targets.
  MeasuredGainModel(std::unique_ptr<GainModel> gain_model, std::vector<Measurement> scans,
                    MeasuredTargets planned, std::optional<MeasuredTargets> fresh,
                    double relaxed_uncertainty_m);

  // Measured scans satisfy targets by their points. They count as feasible, since they were made.
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override;
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override;
  // The other scans must satisfy the targets that the points leave open. Information densities
  // add up (docs/method.md): the density of the points is the one that gives the same
  // uncertainty as they do, and likewise for the other scans. All targets are always
  // evaluated.
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> scans, bool thorough) override;
  absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> scans) override;

  // Uncertainties of all targets after a plan and after each of its scans, computed alike. Only for
  // plans for uncertainty.
  absl::StatusOr<PosteriorUncertainties> Uncertainties(std::span<const Measurement> scans) const;

  const TargetBits& measurable() const override { return gain_model_->measurable(); }
  const TargetBits& validation_measurable() const override {
    return gain_model_->validation_measurable();
  }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    return gain_model_->Gains(measurements, known);
  }
  absl::StatusOr<std::vector<ScanGain>> WeightedGains(std::span<const Measurement> measurements,
                                                      std::span<const float> weights) override {
    return gain_model_->WeightedGains(measurements, weights);
  }
  int64_t evaluations() const override { return gain_model_->evaluations(); }
  absl::Status SetWeights(const GainWeights& weights) override {
    return gain_model_->SetWeights(weights);
  }
  std::vector<ShareStep> steps() const override { return gain_model_->steps(); }
  bool ScoresPlans() const override { return gain_model_->ScoresPlans(); }

 private:
  // Index of the measured scan that equals a measurement.
  std::optional<size_t> MeasuredIndex(const Measurement& scan) const;
  // Replaces those `coverages` that belong to measured scans by the points' coverage; change(index
  // of the measured scan, coverage) sets the rest.
  template <typename Change>
  absl::StatusOr<std::vector<ScanCoverage>> AsMeasured(
      absl::StatusOr<std::vector<ScanCoverage>> coverages,
      std::span<const Measurement> measurements, const Change& change) const;
  struct Counts {
    int64_t satisfied = 0, relaxed = 0;
  };
  absl::StatusOr<Counts> Count(const MeasuredTargets& targets,
                               std::span<const Measurement> scans) const;

  std::unique_ptr<GainModel> gain_model_;
  std::vector<Measurement> scans_;
  MeasuredTargets planned_;
  std::optional<MeasuredTargets> fresh_;
  double relaxed_uncertainty_m_;
};

}  // namespace sightline
