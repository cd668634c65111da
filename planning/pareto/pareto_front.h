// SPDX-License-Identifier: Apache-2.0
// Plans that do not dominate one another in number of scans, seconds and satisfied
// targets.
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

// True if `a` is at least as good as `b` in every objective and better in one.
bool Dominates(const ParetoPoint& a, const ParetoPoint& b);

struct ParetoFront {
  std::vector<ParetoPoint> points;     // none dominates another, no two are equal in all objectives
  std::vector<ParetoPoint> dominated;  // the others, in their order; without equals of points
};

// Sorts points by scans, then seconds. Of points with equal objectives the first one stays. Plans
// without scans are left out.
ParetoFront FrontOf(std::vector<ParetoPoint> found);

// Index of the default choice: fewest scans that reach the goal, then least seconds. If none
// reaches it, the point with the most satisfied targets. Nothing for an empty front.
std::optional<size_t> PointForGoal(const std::vector<ParetoPoint>& points);

}  // namespace sightline
