// SPDX-License-Identifier: Apache-2.0
// Where the line is and how wide, before anything is fitted.
#pragma once

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// Of the recorded line over the expected one, across it, by the moments of what is well above the
// background.
struct LineDisplacement {
  double shift_px = 0;
  double broadening_px2 =
      0;  // of the variance; cut off with the flanks, too small by a fifth or so
};
LineDisplacement DisplacementOfLine(const RecordedSet& set, const ExpectedSet& expected, int frame);

}  // namespace sightline
