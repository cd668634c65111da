// SPDX-License-Identifier: Apache-2.0
// Remaining time of work that progresses at a constant rate.
#pragma once

#include <chrono>
#include <string>

namespace sightline {

// ", about 12 min left" for work that is done to `fraction` in [0, 1] after `passed`, at a constant
// rate. Empty in the first ten seconds and the first 2 %, when an estimate is unreliable.
std::string TimeLeftText(std::chrono::duration<double> passed, double fraction);

}  // namespace sightline
