// SPDX-License-Identifier: Apache-2.0
// Patterns of whole columns and rows: individual values, and periods.
#pragma once

#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/fixed_pattern.h"

namespace sightline {

// Tests columns, then rows: chi squared of the means of the lines; and the strongest period, unless
// there are too few lines. Material above kMaterialPattern.
std::vector<Departure> LinePatterns(const FixedPattern& pattern);

}  // namespace sightline
