// SPDX-License-Identifier: Apache-2.0
// Removal of hot and dead pixels, because a few of them spoil every variance.
#pragma once

#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// Replaces every pixel that is an isolated outlier of eight standard deviations in any recording,
// in a dark frame or away from the line, by the mean of its neighbours of the same colour in all
// recordings. Pixels are identified by their position on the sensor; regions of interest may
// differ. A planned set is returned as it is.
RecordedSet WithoutHotPixels(const RecordedSet& set);

}  // namespace sightline
