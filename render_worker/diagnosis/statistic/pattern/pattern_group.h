// SPDX-License-Identifier: Apache-2.0
// Recordings of the same region of the sensor that FixedPatternStatistic compares: one observation
// block.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/pattern/relative_residuals.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

// Segments along the line about whose means residuals are taken. Chosen as for the set's model.
inline constexpr int kPatternSegments = 4;

struct PatternGroup {
  std::vector<int> frames;  // in order of time; with laser one of each plate position
  bool laser = false;
  RegionOfInterest roi;
  double offset_dn = 0;  // nominal mean in the dark
  double noise_dn = 0;   // nominal standard deviation in the dark
  size_t longest = 0;    // of dark frames: index into `frames` of the longest exposure
  // With laser, of every recording; empty: the set is only planned.
  std::vector<RowWeights> weights;
};

}  // namespace sightline
