// SPDX-License-Identifier: Apache-2.0
// Single pixels far out of line: a few spoil every variance, so they are looked at by themselves.
#pragma once

#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// The set with every pixel that stands out alone, in a dark frame or away from the line, by eight
// standard deviations in any recording, replaced by its neighbours of the same colour in all of
// them. Places are those on the sensor; regions of interest may differ.
RecordedSet WithoutHotPixels(const RecordedSet& set);

}  // namespace sightline
