// SPDX-License-Identifier: Apache-2.0
// Reduces the number of scans with the generated columns of the lower bound: the scans of largest
// weight in the linear relaxation. Some of them complement one another in ways that planning one
// scan at a time does not find. This is price and branch: it solves the integer problem over the
// columns of the relaxation, here by annealing and polishing instead of branching.
#pragma once

#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"

namespace sightline {

// Plans again from `plan`, the result of `request`. Candidates are the bound's generated columns
// and all scans of the first search; the budget is as large again. Returns the plan with fewer
// scans, or `plan` if none with fewer reaches the goal; evaluations are the sum of both. Returns
// `plan` unchanged if a converged bound excludes fewer scans, if the strategy uses no candidates,
// or if `plan` misses the goal. Errors of the gain model.
absl::StatusOr<PlannerResult> PlanWithGeneratedColumns(GainModel& gain_model,
                                                       const PlannerRequest& request,
                                                       PlannerResult plan,
                                                       const ScanCountBoundResult& bound);

}  // namespace sightline
