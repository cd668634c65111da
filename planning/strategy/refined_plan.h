// SPDX-License-Identifier: Apache-2.0
// The project's own strategy: fewer scans than greedy planning for the same coverage.
//
// 1. A quick greedy plan with short swarm searches; the best different scans of every search go
//    into a pool with the targets they cover.
// 2. Simulated annealing over the pool, by exchanges of one scan, to cover most with a given number
//    of scans.
// 3. Polishing: one scan after the other moves in the continuous parameters to cover most of the
//    targets that the others leave; the scan that contributes least is searched again.
// 4. When the plan reaches the goal by the estimate, scans are dropped as long as 2 alone makes
//    their loss good; the smallest such plan is evaluated exactly. If it reaches the goal, one more
//    scan is dropped, and 2 and 3 go on with the rest until the budget is used up or the pace of
//    the last rounds is too slow to reach the goal within it. A draft ends here.
//
// The budget is that of greedy planning: request().evaluations_per_scan times the number of scans
// of the best plan so far, so a result with fewer scans than greedy has also used fewer
// evaluations. The optimiser sees fast estimates; a plan counts once its exact coverage reaches
// the goal, and the difference seen then corrects the number of fast targets to aim at.
#pragma once

#include "planning/strategy/plan_run.h"

namespace sightline {

absl::StatusOr<PlannerResult> PlanRefined(PlanRun& run);

}  // namespace sightline
