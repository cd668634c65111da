// SPDX-License-Identifier: Apache-2.0
// Differential nonlinearity of the converter with a period of two codes, from the histogram of raw
// values.
#pragma once

#include "core/recordings/raw_numbers.h"
#include "render_worker/sensor_diagnosis/departure.h"

namespace sightline {

// Width of odd codes minus that of even ones, over a step. `largest`: 2^bits - 1. Not testable if
// fewer than six ranges of nine codes occur often enough, or if ranges contradict one another.
// Material above 2 % of a step.
Departure OddEvenWidth(const Histogram& histogram, int largest);

}  // namespace sightline
