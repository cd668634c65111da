// SPDX-License-Identifier: Apache-2.0
// Greedy next-best-scan planning (thesis algorithm 3).
#pragma once

#include <functional>
#include <vector>

#include "planning/strategy/plan_run.h"

namespace sightline {

// Finds the scans of largest gain given `known` (accumulated information of all targets). The best
// comes first; others replace it if exact evaluation rejects it. `scans` have been chosen so far.
using NextBestScans = std::function<absl::StatusOr<std::vector<Measurement>>(
    const std::vector<float>& known, int64_t scans, uint64_t seed)>;

// Adds the next best scan to locked and starting scans until the goal, the greatest number of
// scans or the time is reached, or until two searches in a row find no scan that adds the least
// gain. Whether the goal is reached is decided by exact scores.
absl::StatusOr<PlannerResult> PlanGreedily(PlanRun& run, const NextBestScans& next_best);

struct GreedySearch {
  Method method = Method::kParticleSwarm;
  MaximiseOptions options;
};

// Searches with an optimiser, request().evaluations_per_scan evaluations per scan.
NextBestScans SearchWith(PlanRun& run, const GreedySearch& search);

}  // namespace sightline
