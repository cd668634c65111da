// SPDX-License-Identifier: Apache-2.0
#include "planning/multi_start/start_result.h"

#include <tuple>

namespace sightline {

bool IsBetterStart(const StartResult& a, const StartResult& b) {
  const bool a_reaches = a.stop_reason == StopReason::kGoalReached;
  const bool b_reaches = b.stop_reason == StopReason::kGoalReached;
  if (a_reaches != b_reaches) return a_reaches;
  const auto effort = [](const StartResult& start) {
    return std::tuple(start.cost, start.scans.size());
  };
  return a_reaches ? std::tuple(effort(a), -a.satisfied, a.seed) <
                         std::tuple(effort(b), -b.satisfied, b.seed)
                   : std::tuple(-a.satisfied, effort(a), a.seed) <
                         std::tuple(-b.satisfied, effort(b), b.seed);
}

}  // namespace sightline
