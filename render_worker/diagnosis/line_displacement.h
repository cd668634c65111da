// Where the line is, before anything is fitted.
#pragma once

#include "render_worker/diagnosis/recorded_set.h"
#include "render_worker/diagnosis/set_statistic.h"

namespace sightline {

// Place of the recorded line from where it is expected, across it, by the centroids of what is well
// above the background [px].
double LineDisplacementPx(const RecordedSet& set, const ExpectedSet& expected, int frame);

}  // namespace sightline
