// SPDX-License-Identifier: Apache-2.0
// Laser line points of two exposures of the same scene taken together.
#pragma once

#include <vector>

#include "core/laser_line/detect_laser_line.h"

namespace sightline {

// Points of the long exposure that are not clipped, and of the short exposure those that are
// farther than `apart_px` from all of these in their column: bright places are taken from the short
// exposure, dark ones from the long. Clipped points of the long exposure count where the short has
// none within `apart_px`. Both by column, then row; so is the result.
std::vector<LinePoint> MergeExposures(const std::vector<LinePoint>& long_exposure,
                                      const std::vector<LinePoint>& short_exposure,
                                      double apart_px);

}  // namespace sightline
