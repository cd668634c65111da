// SPDX-License-Identifier: Apache-2.0
// One of several searches for the same plan that differ in their seeds alone, and which of them is
// the best: strategies are random searches, so that some seeds need a scan less than others.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/rig/measurement.h"
#include "planning/strategy/planner.h"
#include "planning/strategy/scan_count_bound.h"

namespace sightline {

// The data from which the plan of a search is made again, by evaluating its scans.
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
  // Without its scans.
  std::optional<ScanCountBoundResult> bound;
};

// Whether `a` is to be chosen rather than `b`: it reaches the goal and `b` does not. If both do:
// less cost, then fewer scans, then more that is satisfied, then the lower seed. If neither does:
// more that is satisfied, then less cost, then fewer scans, then the lower seed. An order of
// results of different seeds, so that the best of them does not depend on which ended first.
bool IsBetterStart(const StartResult& a, const StartResult& b);

}  // namespace sightline
