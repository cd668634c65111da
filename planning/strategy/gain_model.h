// SPDX-License-Identifier: Apache-2.0
// Gain model: the information of scans about targets, as strategies see it. The clients of the
// coverage server implement it for coverage and for uncertainty; tests use analytic ones.
#pragma once

#include <atomic>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/rig/measurement.h"
#include "core/targets/target_set.h"
#include "planning/strategy/target_shares.h"

namespace sightline {

struct GainWeights;

enum class ScanFeasibility { kFeasible, kCollision, kTravel, kOutOfBounds, kUnreachable };

struct ScanGain {
  ScanFeasibility feasibility = ScanFeasibility::kFeasible;
  int32_t new_targets = 0;      // that the scan satisfies
  int32_t covered_targets = 0;  // measurable
  double weighted_gain = 0;
  double gain = 0;  // the value that a search maximises; coverage: new_targets
};

struct ScanCoverage {
  ScanFeasibility feasibility = ScanFeasibility::kFeasible;
  TargetBits covered;  // measurable targets only
  // Exact evaluation only:
  TargetBits covered_without_normal_gate;
  int32_t first_frame = 0;
  int32_t last_frame = -1;
  int64_t measurement_points = 0;
  // Covered validation targets, if the gain model has such.
  TargetBits validation_covered;
  // Set by fast evaluation of gain models that score whole plans; otherwise covered targets have a
  // fraction of 1.
  TargetShares shares;
};

// A plan as a whole, exact: targets that it satisfies, and that it nearly satisfies (a relaxed
// uncertainty; coverage: the same). Counts of validation targets are unset if there are none.
struct PlanScore {
  int64_t satisfied = 0;
  int64_t relaxed = 0;
  int64_t measurable = 0;
  std::optional<int64_t> validation_satisfied;
  std::optional<int64_t> validation_relaxed;
  int64_t validation_measurable = 0;

  // Satisfied targets that the plan can claim: no larger fraction than of the validation targets.
  int64_t Claimed() const {
    if (!validation_satisfied || validation_measurable == 0) return satisfied;
    const auto fresh = static_cast<int64_t>(static_cast<double>(*validation_satisfied) /
                                            static_cast<double>(validation_measurable) *
                                            static_cast<double>(measurable));
    return fresh < satisfied ? fresh : satisfied;
  }
};

class GainModel {
 public:
  virtual ~GainModel() = default;
  // Targets to be satisfied by plans.
  virtual const TargetBits& measurable() const = 0;
  // Validation targets that plans are also scored on; empty if there are none.
  virtual const TargetBits& validation_measurable() const {
    static const TargetBits none;
    return none;
  }
  // Fast estimates, one result per measurement, in order. `known`: accumulated information of
  // earlier scans about all targets. Infeasible scans have zero gain.
  virtual absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                                      std::span<const float> known) = 0;
  // weighted_gain: sum over targets of weight times min(1, fraction by this scan).
  virtual absl::StatusOr<std::vector<ScanGain>> WeightedGains(
      std::span<const Measurement> measurements, std::span<const float> weights) = 0;
  virtual absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) = 0;
  virtual absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) = 0;
  // Number of measurements evaluated so far by Gains, WeightedGains and FastCoverage.
  virtual int64_t evaluations() const = 0;

  // Sets the weights of the gain that later searches maximise. A gain model that wraps another one
  // forwards them. UNIMPLEMENTED if this model's gain has no weights.
  virtual absl::Status SetWeights(const GainWeights& /*weights*/) {
    return absl::UnimplementedError("this gain has no weights");
  }

  // Steps of the gain, as far as it consists of steps; used by searches over pools.
  virtual std::vector<ShareStep> steps() const { return {{1.0, {1.0f}}}; }
  // True if several scans together satisfy more targets than each by itself, so that only whole
  // plans can be scored exactly. False if a plan satisfies exactly what its scans cover.
  virtual bool ScoresPlans() const { return false; }
  // Exact score. `thorough`: over all targets; otherwise estimated from a subset. Only if
  // ScoresPlans().
  virtual absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> /*scans*/,
                                              bool /*thorough*/) {
    return absl::UnimplementedError("plans are scored by their scans' coverage");
  }
  // Exact scores of the first scan, the first two, and so on; without validation targets.
  virtual absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> /*scans*/) {
    return absl::UnimplementedError("plans are scored by their scans' coverage");
  }
};

}  // namespace sightline
