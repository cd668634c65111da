// SPDX-License-Identifier: Apache-2.0
// Start values of laser power and beam width from the images, for sets that do not state them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/recordings/recordings.h"

namespace sightline {

// From these relative standard uncertainties on, power and divergence count as not stated: usual
// values are then off by orders of magnitude, and a fit needs a start.
inline constexpr double kUnknownPower = 1, kUnknownDivergence = 0.2;

// Sets power and divergence of a reduced set (ReducePosedPlates) so that the median line has the
// height and the width that the images show. A line that is clipped is extrapolated by a Gaussian
// profile through its widths at the clip level and at half of it. That is good to a factor of
// three where speckle clips in part. The uncertainties stay. Returns a sentence for each value;
// empty: both are stated, or no image shows a line.
std::vector<std::string> StartFromImages(const std::vector<Image<uint16_t>>& raw_dn,
                                         RecordingSet* set);

}  // namespace sightline
