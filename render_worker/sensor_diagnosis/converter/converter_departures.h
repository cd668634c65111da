// SPDX-License-Identifier: Apache-2.0
// Departures of the analogue-to-digital converter visible in the histogram of raw values.
#pragma once

#include <cstdint>
#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"

namespace sightline {

// Missing codes, odd and even codes of unequal width, and a black level that is clipped at 0.
// `counts`: of all values [0, 2^bits), over all frames. They also determine the clip level; the
// lowest and the highest value that occur are regarded as clipped. `share_of_dark_at_zero`:
// fraction of the pixels of a dark step that are 0; the largest of all steps. Material: 5 % of the
// codes missing or a step above 1, 2 % of a step, 0.01 % of the pixels.
std::vector<Departure> ConverterDepartures(const std::vector<int64_t>& counts, int bit_depth_bit,
                                           double share_of_dark_at_zero);

}  // namespace sightline
