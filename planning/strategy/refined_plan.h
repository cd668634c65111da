// SPDX-License-Identifier: Apache-2.0
// Refined strategy: fewer scans than greedy planning for the same coverage.
//
// 1. A quick greedy plan with short swarm searches. The best different scans of every search enter
//    a pool with the targets that they cover.
// 2. Simulated annealing over the pool, by exchanges of one scan, to cover most with a given number
//    of scans.
// 3. Polishing. One scan after the other moves in its continuous parameters to cover most of the
//    targets left by the others; the scan that contributes least is searched again.
// 4. Once the plan reaches the goal by the estimate, scans are dropped as long as step 2 alone
//    makes up for it. The smallest such plan is evaluated exactly. If it reaches the goal, one more
//    scan is dropped, and steps 2 and 3 continue until the budget is used up or the last rounds
//    progress too slowly to reach the goal within it. A draft ends here.
//
// The budget is that of greedy planning: request().evaluations_per_scan times the number of scans
// of the best plan so far. A result with fewer scans than greedy has thus also used fewer
// evaluations. The optimiser uses fast estimates. A plan counts once its exact coverage reaches the
// goal; the observed difference then corrects the number of fast targets to aim at.
#pragma once

#include "planning/strategy/plan_run.h"

namespace sightline {

absl::StatusOr<PlannerResult> PlanRefined(PlanRun& run);

}  // namespace sightline
