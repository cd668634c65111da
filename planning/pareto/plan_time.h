// SPDX-License-Identifier: Apache-2.0
// Seconds that a plan takes to execute (thesis eq. 2.1).
#pragma once

#include <span>

#include "core/inspection/inspection.h"
#include "core/rig/measurement.h"
#include "planning/strategy/execution/execution_model.h"

namespace sightline {

// First and last frame that yield a point, in multiples of the scan step; none if last < first.
struct FrameRange {
  int first = 0;
  int last = -1;
};

struct PlanTime {
  double scan_s = 0;        // from first to last frame of every scan
  double frame_rate_s = 0;  // part of scan_s: how much longer frames take than the stage alone
  double reposition_s = 0;  // set-up and moves between scans, in the best order
  double Total_s() const { return scan_s + reposition_s; }
};

// `frames`: one range per scan, in steps of `scan_step_m` > 0. The first `locked` scans stay first.
// If only the frame rate is limited, all of scan_s is frame_rate_s. All times are 0 for unit costs.
PlanTime TimeOfPlan(const ExecutionModel& execution, double scan_step_m,
                    std::span<const Measurement> scans, std::span<const FrameRange> frames,
                    int locked);

}  // namespace sightline
