// SPDX-License-Identifier: Apache-2.0
// Patterns of whole columns and rows: values of their own, and periods.
#pragma once

#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/fixed_pattern.h"

namespace sightline {

// For columns, then for rows: chi squared of the means of the lines; and the strongest period,
// unless there are too few lines. Material from kMaterialPattern on.
std::vector<Departure> LinePatterns(const FixedPattern& pattern);

}  // namespace sightline
