// SPDX-License-Identifier: Apache-2.0
// How long work will still take whose progress follows time.
#pragma once

#include <chrono>
#include <string>

namespace sightline {

// ", about 12 min left" if work that has taken `passed` for `fraction` of it in [0, 1] goes on as
// it has so far; empty while that says nothing: in the first ten seconds and the first 2 %.
std::string TimeLeftText(std::chrono::duration<double> passed, double fraction);

}  // namespace sightline
