// SPDX-License-Identifier: Apache-2.0
// Plans whose first scans have been measured: their points say which targets they satisfy. For the
// other scans simulation on the part as it was found does.
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
  // `scans`: those measured, as plans name them. `planned`, `fresh`: the information of their
  // points about the targets of `gain model`; fresh: unset if that has no validation targets.
  MeasuredGainModel(std::unique_ptr<GainModel> gain_model, std::vector<Measurement> scans,
                    MeasuredTargets planned, std::optional<MeasuredTargets> fresh,
                    double relaxed_uncertainty_m);

  // Measured scans satisfy targets by their points; they are feasible, since they have been made.
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override;
  absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) override;
  // Targets that the points leave open are those that the other scans must satisfy. Information
  // densities add up (docs/method.md): that of the points is the density after which the surface
  // would be known as well as they make it known, that of the others likewise. The whole of the
  // targets is always looked at.
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> scans, bool thorough) override;
  absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> scans) override;

  // Uncertainties of all targets after a plan and after each of its scans, likewise. Only of plans
  // for uncertainty.
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
  // Index of the measured scan that a measurement is.
  std::optional<size_t> MeasuredIndex(const Measurement& scan) const;
  // `coverages` of `measurements`, those of measured scans by their points; change(index of the
  // measured scan, coverage) sets the rest.
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
