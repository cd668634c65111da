// SPDX-License-Identifier: Apache-2.0
// Greedy next-best-scan planning (thesis algorithm 3).
#pragma once

#include <functional>
#include <vector>

#include "planning/strategy/plan_run.h"

namespace sightline {

// Returns the scans of largest gain given `known` (accumulated information of all targets), best
// first. The others are tried if exact evaluation rejects the best. `scans`: chosen so far.
using NextBestScans = std::function<absl::StatusOr<std::vector<Measurement>>(
    const std::vector<float>& known, int64_t scans, uint64_t seed)>;

// Adds the next best scan to locked and starting scans until the goal, the largest number of scans
// or the time limit is reached, or until two searches in a row find no scan with the least gain.
// Exact scores decide if the goal is reached.
absl::StatusOr<PlannerResult> PlanGreedily(PlanRun& run, const NextBestScans& next_best);

struct GreedySearch {
  Method method = Method::kParticleSwarm;
  MaximiseOptions options;
};

// Searches with an optimiser, request().evaluations_per_scan evaluations per scan.
NextBestScans SearchWith(PlanRun& run, const GreedySearch& search);

}  // namespace sightline
