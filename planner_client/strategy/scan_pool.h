// Covering most targets with a given number of scans out of a pool (maximum coverage).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/targets/target_set.h"
#include "planner_client/optimise/random.h"

namespace sightline {

// Index of a set in a pool of target sets.
using PoolPlan = std::vector<size_t>;

TargetBits CoveredBy(const std::vector<TargetBits>& pool, const PoolPlan& plan, size_t targets);

// Targets that only plan[i] covers, for each i.
std::vector<TargetBits> UniqueTargets(const std::vector<TargetBits>& pool, const PoolPlan& plan,
                                      size_t targets);

// Adds the set with the most new targets (the first of equal ones) until the plan has `size` sets
// or covers `goal` targets.
void CompleteGreedily(const std::vector<TargetBits>& pool, PoolPlan& plan, size_t size,
                      int64_t goal, size_t targets);

// Exchanges a set of the plan, from place `fixed` on, for one of the pool as long as that covers
// more targets; the best exchange first.
void ExchangeWhileBetter(const std::vector<TargetBits>& pool, PoolPlan& plan, size_t fixed,
                         size_t targets);

// Maximum coverage by ruin and recreate: removes up to three sets (from place `fixed` on),
// completes greedily, exchanges; keeps the result if it covers at least as much. Sets that add
// nothing may be left out. Stops after
// `rounds` rounds, at `goal` covered targets, or when `stop` says so.
PoolPlan ImproveCoverage(const std::vector<TargetBits>& pool, PoolPlan plan, size_t fixed,
                         int64_t goal, int rounds, size_t targets, Random& random,
                         const std::function<bool()>& stop);

}  // namespace sightline
