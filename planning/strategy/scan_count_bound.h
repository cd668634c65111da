// SPDX-License-Identifier: Apache-2.0
// A lower bound on the number of scans that any plan needs.
//
// Let a_st in [0, 1] be the fraction of the information required by target t that scan s gives
// (coverage: 1 if s covers t). A plan satisfies t only if its scans' fractions add up to at
// least 1. Give every target a weight pi_t >= 0 such that no scan brings more than sum_t pi_t a_st
// = 1. Then a plan of n scans that satisfies a set T of at least G targets satisfies
//   n >= sum_s sum_t pi_t a_st >= sum_{t in T} pi_t >= sum of the G smallest pi_t,
// the bound. It holds for any such weights; the best ones solve the dual of the linear relaxation
// of partial (multi-)cover,
//   max G lambda - sum_t mu_t   s.t.  mu_t >= lambda - pi_t,  sum_t pi_t a_st <= 1 for every scan,
//   pi, lambda, mu >= 0,
// whose optimum at given pi is exactly the sum of the G smallest. There are infinitely many scans,
// so columns are generated (Gilmore and Gomory 1961): particle swarms search the nine parameters
// for the scan of largest weight. Targets satisfied by nearly the same known scans share one
// weight, which keeps the linear programme small and the bound valid.
//
// The search may miss the scan of largest weight. The weights are divided by the largest weight
// found, so the bound is only as good as the search.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "planning/strategy/gain_model.h"

namespace sightline {

struct ScanCountBoundResult {
  // Lower bound on the number of scans; `scans` is the smallest whole number not below it.
  double bound = 0;
  int scans = 0;
  // True if a search with the bound's own weights and the full budget of a round (a tenth of all)
  // found no scan of weight above 1 + 0.005. In both cases `bound` accounts for the largest weight
  // found anywhere.
  bool converged = false;
  int64_t evaluations = 0;  // of pricing and of the scans' coverage
  int64_t last_round_evaluations = 0;
  std::vector<Measurement> generated_columns;  // feasible scans that determined the weights
  int rounds = 0;
  int64_t goal_targets = 0;        // G
  int64_t measurable_targets = 0;  // measurable
  std::vector<double> weights;     // pi, one for every target
  std::string statement;           // the result as a sentence, with the extent of the search
};

struct ScanCountBoundProgress {
  double bound = 0;
  int64_t evaluations = 0;
  int64_t budget = 0;
};

// Lower bound on the number of scans that satisfy at least `goal` (0, 1] of the targets, by fast
// estimates, with at most `budget` > 0 evaluations. `initial_scans`, e.g. those of a plan, speed up
// the search; infeasible ones are ignored. If interrupted, returns the best bound so far.
// INVALID_ARGUMENT for a goal or budget out of range; errors of the gain model are passed on.
absl::StatusOr<ScanCountBoundResult> BoundScanCount(
    GainModel& gain_model, const MeasurementDomain& domain, double goal,
    std::span<const Measurement> initial_scans, int64_t budget, int64_t seed,
    const std::function<void(const ScanCountBoundProgress&)>& on_progress = {},
    const std::atomic<bool>* interrupted = nullptr);

// Adjusts the bound to a plan that satisfies the goal exactly: weights are divided by the largest
// weight of its scans. The bound can slightly exceed the plan's number of scans if fast and exact
// targets differ. Changes nothing if a scan lies outside `domain`, to which the bound applies.
// Errors of the gain model.
absl::Status TakeIntoAccount(GainModel& gain_model, const MeasurementDomain& domain,
                             std::span<const Measurement> plan, ScanCountBoundResult& bound);

// Adjusts the bound to a smaller `goal_targets`: the sum of as many smallest weights. It stays
// valid, though weights optimised for this goal might give a larger bound. `measurable`: of the
// gain model that the bound was made with.
void LowerGoal(const TargetBits& measurable, int64_t goal_targets, ScanCountBoundResult& bound);

}  // namespace sightline
