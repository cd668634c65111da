// SPDX-License-Identifier: Apache-2.0
// Position and width of the recorded line, before anything is fitted.
#pragma once

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// Difference of the recorded line from the expected one across it, by the moments of the signal
// well above the background.
struct LineDisplacement {
  double shift_px = 0;
  // Difference of the variances. The threshold cuts the flanks off, so it is about a fifth too
  // small.
  double broadening_px2 = 0;
};
// `frame`: a lit recording.
LineDisplacement DisplacementOfLine(const RecordedSet& set, const ExpectedSet& expected, int frame);

}  // namespace sightline
