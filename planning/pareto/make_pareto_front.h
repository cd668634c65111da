// SPDX-License-Identifier: Apache-2.0
// The trade-off between number of scans, seconds and satisfied surface of a task.
//
// It uses the epsilon-constraint method (Haimes, Lasdon, Wismer 1971): one objective is maximised
// while the others are bounded, for a series of bounds.
//
// 1. The plan for the goal, as it is made without a front. It is one of the points, so a front is
//    never worse than that plan.
// 2. The plan that satisfies most with n scans, for every n from that plan's number down to the
//    locked scans (at least one), then upwards. The refined strategy starts from the neighbour
//    with one scan less or more and may use all good scans found so far.
// 3. The plan that satisfies most within a time limit (timed_search.h), for a series of limits from
//    the longest plan down. It starts from the best known plan that fits. Fewer scans within the
//    same time are tried as long as the plan of step 2 with so many scans takes longer.
// 4. If one of these plans reaches the goal: limits just below the quickest such plan, as long as
//    that gains something.
//
// These bounds suit the task better than a genetic search for the whole front (NSGA-II). Every
// point is a maximum coverage problem: exchanges over a pool of known scans find in milliseconds
// what a crossover of plans would meet only by chance. One exact evaluation of a plan costs as much
// as hundreds of gains.
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
  // Goal, locked scans, effort and stop checks as for one plan. Its time limit covers the whole
  // front, its progress callback is not called, and its strategy must be "refined".
  PlannerRequest plan;
  // With unit costs the front trades scans against satisfied targets only.
  ExecutionModel execution;
  double scan_step_m = 0.001;
  // Fast, rough estimate; if empty, the gain model computes exact frames.
  std::function<FrameRange(const Measurement&)> estimate_frames;
  int time_limits = 20;  // [0, 1000]
  // Called with the progress in [0, 1] and a text.
  std::function<void(double, const std::string&)> on_progress;
};

struct ParetoResult {
  ParetoFront front;  // at least one point
  StopReason stop_reason = StopReason::kStalled;
  int64_t evaluations = 0;
  // Stop reason of the plan for the goal alone.
  StopReason plan_stop_reason = StopReason::kStalled;
};

// INVALID_ARGUMENT as MakePlan, and for a strategy other than "refined". FAILED_PRECONDITION with
// the reason if no scan satisfies anything. CANCELLED if stopped before the first plan; a later
// stop returns the front so far. Errors of the gain model are passed on.
absl::StatusOr<ParetoResult> MakeParetoFront(GainModel& gain_model, const ParetoRequest& request);

}  // namespace sightline
