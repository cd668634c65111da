// SPDX-License-Identifier: Apache-2.0
#include "planner_client/multi_start/start_result.h"

#include <tuple>

namespace sightline {

bool IsBetterStart(const StartResult& a, const StartResult& b) {
  const bool a_reaches = a.stop_reason == StopReason::kGoalReached;
  const bool b_reaches = b.stop_reason == StopReason::kGoalReached;
  if (a_reaches != b_reaches) return a_reaches;
  const size_t a_scans = a.scans.size();
  const size_t b_scans = b.scans.size();
  return a_reaches
             ? std::tuple(a_scans, -a.settled, a.seed) < std::tuple(b_scans, -b.settled, b.seed)
             : std::tuple(-a.settled, a_scans, a.seed) < std::tuple(-b.settled, b_scans, b.seed);
}

}  // namespace sightline
