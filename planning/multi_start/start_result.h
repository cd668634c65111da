// SPDX-License-Identifier: Apache-2.0
// Result of one of several searches for the same plan that differ only in their seeds, and the
// order that ranks them. Strategies search at random, so some seeds need a scan less than others.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/rig/measurement.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"

namespace sightline {

// Data from which the plan is made again, by evaluating its scans.
struct StartResult {
  struct Scan {
    Measurement measurement;
    bool locked = false;
    friend bool operator==(const Scan&, const Scan&) = default;
  };
  int64_t seed = 0;
  StopReason stop_reason = StopReason::kStalled;
  int64_t evaluations = 0;
  double satisfied = 0;  // targets that the plan can claim, of those to be satisfied, in [0, 1]
  double cost = 0;       // of executing its plan, as v1::PlanCost.total
  std::vector<Scan> scans;
  // The bound without its generated columns.
  std::optional<ScanCountBoundResult> bound;
};

// True if `a` is the better result: it reaches the goal and `b` does not. If both reach it: lower
// cost, then fewer scans, then a larger satisfied fraction, then the lower seed. If neither does: a
// larger satisfied fraction, then lower cost, fewer scans, the lower seed. This strict order of
// results with different seeds makes the best one independent of the order in which they ended.
bool IsBetterStart(const StartResult& a, const StartResult& b);

}  // namespace sightline
