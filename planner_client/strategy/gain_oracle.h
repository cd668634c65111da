// SPDX-License-Identifier: Apache-2.0
// What a planning strategy asks: what scans tell of the targets that are to be settled. The clients
// of the coverage server implement it for coverage and for uncertainty; tests use analytic ones.
#pragma once

#include <atomic>
#include <optional>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/rig/measurement.h"
#include "core/targets/target_set.h"
#include "planner_client/strategy/target_shares.h"

namespace sightline {

struct GainWeights;

enum class ScanFeasibility { kFeasible, kCollision, kTravel, kOutOfBounds, kUnreachable };

struct ScanGain {
  ScanFeasibility feasibility = ScanFeasibility::kFeasible;
  int32_t new_targets = 0;      // that the scan settles
  int32_t covered_targets = 0;  // measurable
  double weighted_gain = 0;
  double gain = 0;  // what a search maximises; coverage: new_targets
};

struct ScanCoverage {
  ScanFeasibility feasibility = ScanFeasibility::kFeasible;
  TargetBits covered;  // measurable targets only
  // Exact evaluation only:
  TargetBits covered_without_normal_gate;
  int32_t first_frame = 0;
  int32_t last_frame = -1;
  int64_t measurement_points = 0;
  // Of targets sampled anew, if the oracle has such.
  TargetBits fresh_covered;
  // Fast evaluation by oracles that score whole plans only; otherwise what is covered has a share
  // of 1.
  TargetShares shares;
};

// A plan as a whole, exact: targets that it settles, and that it nearly settles (a relaxed
// uncertainty; coverage: the same). Counts of targets sampled anew are unset if there are none.
struct PlanScore {
  int64_t settled = 0;
  int64_t relaxed = 0;
  int64_t judged = 0;
  std::optional<int64_t> fresh_settled;
  std::optional<int64_t> fresh_relaxed;
  int64_t fresh_judged = 0;

  // Settled targets that the plan can claim: as a part of all, no more than on the fresh ones.
  int64_t Claimed() const {
    if (!fresh_settled || fresh_judged == 0) return settled;
    const auto fresh =
        static_cast<int64_t>(static_cast<double>(*fresh_settled) /
                             static_cast<double>(fresh_judged) * static_cast<double>(judged));
    return fresh < settled ? fresh : settled;
  }
};

class GainOracle {
 public:
  virtual ~GainOracle() = default;
  // Targets that plans are to settle.
  virtual const TargetBits& measurable() const = 0;
  // Targets sampled anew that plans are scored on too; empty: none.
  virtual const TargetBits& fresh_measurable() const {
    static const TargetBits none;
    return none;
  }
  // Fast estimates, one result per measurement, in order. `known`: shares of all targets by earlier
  // scans. Infeasible: zero gain.
  virtual absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                                      std::span<const float> known) = 0;
  // weighted_gain: sum over targets of weight times min(1, share by this scan).
  virtual absl::StatusOr<std::vector<ScanGain>> WeightedGains(
      std::span<const Measurement> measurements, std::span<const float> weights) = 0;
  virtual absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) = 0;
  virtual absl::StatusOr<std::vector<ScanCoverage>> ExactCoverage(
      std::span<const Measurement> measurements) = 0;
  // Number of measurements evaluated so far by Gains, WeightedGains and FastCoverage.
  virtual int64_t evaluations() const = 0;

  // Weights of the gain that later searches maximise. An oracle that asks another one forwards
  // them. UNIMPLEMENTED: the gain of this oracle has no weights.
  virtual absl::Status SetWeights(const GainWeights& /*weights*/) {
    return absl::UnimplementedError("this gain has no weights");
  }

  // What gains are made of, as far as steps can say it; for searches over pools of scans.
  virtual std::vector<ShareStep> steps() const { return {{1.0, {1.0f}}}; }
  // Whether what scans settle together is more than what each settles, so that only whole plans can
  // be scored exactly. False: a plan settles what its scans cover.
  virtual bool ScoresPlans() const { return false; }
  // Exact. `thorough`: of all targets; otherwise estimated from a part of them. Only if
  // ScoresPlans().
  virtual absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> /*scans*/,
                                              bool /*thorough*/) {
    return absl::UnimplementedError("plans are scored by their scans' coverage");
  }
  // Exact scores of the first scan, the first two, and so on; without fresh targets.
  virtual absl::StatusOr<std::vector<PlanScore>> ScoreGrowingPlan(
      std::span<const Measurement> /*scans*/) {
    return absl::UnimplementedError("plans are scored by their scans' coverage");
  }
};

}  // namespace sightline
