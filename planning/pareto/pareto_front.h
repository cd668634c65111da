// SPDX-License-Identifier: Apache-2.0
// Plans of which none is better than another in everything that counts: number of scans, seconds,
// satisfied targets.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "absl/status/statusor.h"
#include "planning/pareto/plan_time.h"
#include "planning/strategy/planner.h"

namespace sightline {

struct ParetoPoint {
  std::vector<ChosenScan> scans;  // locked ones first, then by what they add; exact coverage
  PlanScore score;                // exact
  PlanTime time;
  bool reaches_goal = false;

  int64_t Claimed() const { return score.Claimed(); }
};

// At least as good in every objective and better in one.
bool Dominates(const ParetoPoint& a, const ParetoPoint& b);

struct ParetoFront {
  std::vector<ParetoPoint> points;     // none dominates another, no two are equal in all objectives
  std::vector<ParetoPoint> dominated;  // the others, in their order; without equals of points
};

// Points in ascending order of scans, then seconds. Of equal ones the first stays. Plans without
// scans do not count.
ParetoFront FrontOf(std::vector<ParetoPoint> found);

// Indices of points. The plan for those who do not choose: the fewest scans that reach the goal, of
// these the quickest; if none does, that with the most. None of an empty front.
std::optional<size_t> PointForGoal(const std::vector<ParetoPoint>& points);

}  // namespace sightline
