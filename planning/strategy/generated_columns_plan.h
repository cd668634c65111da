// SPDX-License-Identifier: Apache-2.0
// Reduces the number of scans with the generated columns of the lower bound: the scans with the
// largest weight in the linear relaxation. Among them are scans that complement one another, which
// planning one scan at a time does not meet (price and branch: the integer problem over the columns
// of the relaxation, here by annealing and polishing instead of branching).
#pragma once

#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"

namespace sightline {

// Plans again from `plan`, which `request` gave, with the bound's generated columns and all scans
// of the first search as candidates, and another budget of the same size. Returns the plan with
// fewer scans, or `plan` itself if none with fewer reaches the goal; its evaluations are the sum of
// both. Nothing changes if a converged bound leaves no room, for strategies that use no candidates,
// and for plans that do not reach the goal. Errors of the gain model.
absl::StatusOr<PlannerResult> PlanWithGeneratedColumns(GainModel& gain_model,
                                                       const PlannerRequest& request,
                                                       PlannerResult plan,
                                                       const ScanCountBoundResult& bound);

}  // namespace sightline
