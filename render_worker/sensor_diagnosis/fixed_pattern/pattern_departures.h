// SPDX-License-Identifier: Apache-2.0
// Tests of fixed patterns: lines, cells of 2 x 2 pixels, outlying pixels, and the fall-off of the
// light.
#pragma once

#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/fixed_pattern.h"

namespace sightline {

// All tests of the dark, then of the bright pattern. A pattern that the set does not have gives one
// departure that is not testable.
std::vector<Departure> PatternDepartures(const FixedPatterns& patterns);

}  // namespace sightline
