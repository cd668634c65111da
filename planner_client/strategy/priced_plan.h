// SPDX-License-Identifier: Apache-2.0
// Fewer scans by the scans that a lower bound was priced from. Pricing looks for the scans that
// weigh most in the linear relaxation; among them are those that go well together, which planning
// one scan at a time does not meet (price and branch: the integer problem over the columns of the
// relaxation, here by annealing and polishing instead of branching).
#pragma once

#include "planner_client/strategy/planner.h"
#include "planner_client/strategy/scan_count_bound.h"

namespace sightline {

// Plans again from `plan`, which `request` gave, with the bound's priced scans and all those that
// the first search found as candidates, and another budget of the same size. Returns the plan with
// fewer scans, `plan` itself if there is none that reaches the goal with fewer; its evaluations are
// the sum of both. Without any change if a converged bound leaves no room, for strategies that use
// no candidates, and for plans that do not reach the goal. Errors of the oracle.
absl::StatusOr<PlannerResult> PlanWithPricedScans(GainOracle& oracle, const PlannerRequest& request,
                                                  PlannerResult plan,
                                                  const ScanCountBoundResult& bound);

}  // namespace sightline
