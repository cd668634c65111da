// SPDX-License-Identifier: Apache-2.0
// Coverage of a plan under errors of placement: a quantile over simulated executions of the plan.
//
// Each scan is evaluated exactly at a few drawn placements. An execution combines, for every group
// of scans with common errors, one of these. Groups are independent of each other, so far more
// executions than drawn placements follow from the same evaluations (a resampling estimate).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/rig/measurement.h"
#include "core/targets/target_set.h"
#include "planning/placement/placement_draws.h"
#include "planning/strategy/gain_model.h"

namespace sightline {

// Drawn placements of every scan of a plan: 24, and fewer, at least 12, where a plan has more than
// 15 scans, since each takes an exact evaluation.
int PlacementDrawsFor(size_t scans);
// Executions that they are combined to.
inline constexpr int kPlacementExecutions = 2000;

// Numbers of covered targets of executions: covered[d][s] are the targets of scan s at its draw d.
// With one group, the executions are the draws.
std::vector<int64_t> CombineExecutions(const std::vector<std::vector<TargetBits>>& covered,
                                       std::span<const size_t> group_ends, int executions);

// Exact coverage of displaced scans, one displacement each (CoverageClient::DisplacedCoverage).
using DisplacedEvaluation = std::function<absl::StatusOr<std::vector<ScanCoverage>>(
    std::span<const Measurement>, std::span<const ScanDisplacement>)>;

// The covered fraction of `measurable` targets, of which there are some, that 95 of 100 executions
// exceed. `scans` in the order in which they are made. Errors of `evaluate` are passed on.
absl::StatusOr<double> PlacementCoverage(const PlacementModel& model,
                                         std::span<const Measurement> scans, int64_t measurable,
                                         const DisplacedEvaluation& evaluate);

}  // namespace sightline
