// SPDX-License-Identifier: Apache-2.0
// The trade-off between number of scans, seconds and satisfied surface of a task.
//
// By the epsilon-constraint method (Haimes, Lasdon, Wismer 1971): one objective is maximised while
// the others are bounded, for a row of bounds.
//
// 1. The plan for the goal, as it is made without a front; it is among the points, so a front is
//    never worse than that plan.
// 2. For every number of scans, from that plan's down to the locked ones or one and then up, the
//    plan that satisfies most with so many: the refined strategy, which starts from the neighbour
//    with one scan less or more and may use all good scans found so far.
// 3. For a row of time limits, from the longest plan down, the plan that satisfies most within the
//    limit (timed_search.h), started at the best plan known that fits; and with fewer scans within
//    the same time, as long as the plan of 2 for so many takes longer.
// 4. Where one of these plans reaches the goal, limits just below the quickest such plan, as long
//    as that gains something.
//
// Bounds of this kind suit the task better than a genetic search for the whole front (NSGA-II):
// every point is a maximum coverage problem, in which exchanges over a pool of known scans find in
// milliseconds what crossing plans would have to meet by chance, and a plan evaluated exactly costs
// as much as hundreds of gains.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "planning/pareto/pareto_front.h"
#include "planning/pareto/plan_time.h"
#include "planning/strategy/gain_model.h"
#include "planning/strategy/planner.h"

namespace sightline {

struct ParetoRequest {
  // Goal, locked scans, effort and stop checks as for one plan; the limit on time is for the whole
  // front. Its progress is not called. The strategy must be "refined".
  PlannerRequest plan;
  // With unit costs the front is of scans against satisfied targets only.
  ExecutionModel execution;
  double scan_step_m = 0.001;
  // Fast and rough; empty: exact frames are asked of the gain model.
  std::function<FrameRange(const Measurement&)> estimate_frames;
  int time_limits = 20;  // [0, 1000]
  // In [0, 1], with a text.
  std::function<void(double, const std::string&)> on_progress;
};

struct ParetoResult {
  ParetoFront front;  // at least one point
  StopReason stop_reason = StopReason::kStalled;
  int64_t evaluations = 0;
  // Stop reason of the plan for the goal alone.
  StopReason plan_stop_reason = StopReason::kStalled;
};

// INVALID_ARGUMENT as MakePlan, and for another strategy. FAILED_PRECONDITION, with the reason: no
// scan satisfies anything. CANCELLED: stopped before there was a plan; after that, the front so
// far. Errors of the gain model are passed on.
absl::StatusOr<ParetoResult> MakeParetoFront(GainModel& gain_model, const ParetoRequest& request);

}  // namespace sightline
