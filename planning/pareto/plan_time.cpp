// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/plan_time.h"

#include <cassert>
#include <vector>

#include "planning/strategy/scan_order.h"

namespace sightline {

PlanTime TimeOfPlan(const ExecutionModel& execution, double scan_step_m,
                    std::span<const Measurement> scans, std::span<const FrameRange> frames,
                    int locked) {
  assert(frames.size() == scans.size());
  CostModel stage_alone = execution.costs;
  stage_alone.frame_rate_hz.reset();
  // Sum in the order that a plan uses, so that rounding is identical.
  const std::vector<int> order = OrderScans(execution, scans, locked);
  PlanTime time;
  for (const int i : order) {
    const FrameRange& range = frames[static_cast<size_t>(i)];
    const double scan_s = ScanTimeS(execution.costs, scan_step_m, range.first, range.last);
    time.scan_s += scan_s;
    time.frame_rate_s += scan_s - ScanTimeS(stage_alone, scan_step_m, range.first, range.last);
  }
  if (!scans.empty()) time.reposition_s = TimesBeforeFirst(execution).Total_s();
  time.reposition_s += TotalRepositionTimeS(execution, scans, order);
  return time;
}

}  // namespace sightline
