// SPDX-License-Identifier: Apache-2.0
// Coverage of a plan under errors of placement: a quantile over simulated executions of the plan.
//
// Each scan is evaluated exactly at a few random placements. A simulated execution takes one of
// these for every group of scans with common errors. Groups are independent, so the same
// evaluations give far more executions than placements (a resampling estimate).
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

// Number of random placements per scan: 24, reduced down to 12 for plans of more than 15 scans,
// since each placement needs one exact evaluation.
int PlacementDrawsFor(size_t scans);
// Number of simulated executions that combine these placements.
inline constexpr int kPlacementExecutions = 2000;

// Number of covered targets of each execution. covered[d][s]: targets of scan s at placement d.
// With a single group each placement is one execution.
std::vector<int64_t> CombineExecutions(const std::vector<std::vector<TargetBits>>& covered,
                                       std::span<const size_t> group_ends, int executions);

// Exact coverage of displaced scans, one displacement each (CoverageClient::DisplacedCoverage).
using DisplacedEvaluation = std::function<absl::StatusOr<std::vector<ScanCoverage>>(
    std::span<const Measurement>, std::span<const ScanDisplacement>)>;

// Fraction of `measurable` targets (> 0) that 95 % of the executions cover or exceed. `scans`: in
// the order of execution. Errors of `evaluate` are passed on.
absl::StatusOr<double> PlacementCoverage(const PlacementModel& model,
                                         std::span<const Measurement> scans, int64_t measurable,
                                         const DisplacedEvaluation& evaluate);

}  // namespace sightline
