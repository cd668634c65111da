// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/recordings/time_left.h"

#include <cmath>

#include "absl/strings/str_format.h"

namespace sightline {

std::string TimeLeftText(std::chrono::duration<double> passed, double fraction) {
  if (passed.count() < 10 || !(fraction > 0.02) || fraction >= 1) return "";
  const double left_s = passed.count() * (1 - fraction) / fraction;
  if (left_s < 90) return absl::StrFormat(", about %.0f s left", std::ceil(left_s / 10) * 10);
  if (left_s < 5400) return absl::StrFormat(", about %.0f min left", std::ceil(left_s / 60));
  return absl::StrFormat(", about %.1f h left", left_s / 3600);
}

}  // namespace sightline
