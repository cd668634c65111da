// SPDX-License-Identifier: Apache-2.0
// Merges the laser line points of two exposures of the same scene.
#pragma once

#include <vector>

#include "core/laser_line/detect_laser_line.h"

namespace sightline {

// The result has, in this order of preference: unclipped points of the long exposure; points of the
// short exposure; clipped points of the long exposure. A point is left out if a preferred one is
// within `apart_px` of it in the same column. So dark places come from the long exposure and bright
// ones from the short. Both inputs and the result are ordered by column, then row.
std::vector<LinePoint> MergeExposures(const std::vector<LinePoint>& long_exposure,
                                      const std::vector<LinePoint>& short_exposure,
                                      double apart_px);

}  // namespace sightline
