// SPDX-License-Identifier: Apache-2.0
// The whole search for a plan: few scans first, a lower bound on their number, then least time.
//
// 1. A draft by the request's strategy.
// 2. A lower bound on the number of scans for what the draft satisfies (scan_count_bound.h).
// 3. Planning again with the scans that the bound generated (generated_columns_plan.h).
// 4. Fewer set-ups, where these cost time or the goal limits them (execution/least_time_plan.h).
//
// A limit on planning time applies to steps 1 and 3 together; step 4 gets the remaining time.
// Without a bound, the strategy plans only once, and step 4 follows.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"

namespace sightline {

enum class PlanStep { kPlan, kBound, kPlanAgain, kLeastTime };

// Callbacks during the search; each may be empty.
struct BoundedPlanHooks {
  std::function<void(PlanStep)> on_begin;
  std::function<void(PlanStep, double seconds)> on_end;
  std::function<void(const ScanCountBoundProgress&)> on_bound;
  // The first plan, and each one that replaces it. Its error ends the search.
  std::function<absl::Status(const PlannerResult&)> on_plan;
};

struct BoundedPlan {
  PlannerResult plan;
  std::optional<ScanCountBoundResult> bound;  // unset without a budget, or when interrupted
};

// `bound_evaluations`: budget of the bound, 0 for none. An interruption keeps the plan so far.
// Errors of the gain model, and those of MakePlan.
absl::StatusOr<BoundedPlan> MakeBoundedPlan(GainModel& gain_model, const PlannerRequest& request,
                                            int64_t bound_evaluations,
                                            const BoundedPlanHooks& hooks = {});

}  // namespace sightline
