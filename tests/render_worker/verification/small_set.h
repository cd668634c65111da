// SPDX-License-Identifier: Apache-2.0
// A small clean set of plate recordings, rendered.
#pragma once

#include <vector>

#include "core/recordings/recordings.h"
#include "render_worker/effects/effect.h"

namespace sightline {

// Mono sensor of 10 bits, or the Bayer sensor; images of 128 x 96 px. Exposure sweep with the same
// speckle, a pair of repeats, f-numbers, distances, plate positions, dark frames.
RecordingSet SmallSet(ColourFilter filter);

// All images of it, one thread. `deviation`: true minus nominal.
std::vector<Image<uint16_t>> RenderSet(const RecordingSet& set, uint64_t seed,
                                       const std::vector<ActiveEffect>& effects = {},
                                       const SetupDeviation& deviation = {}, bool speckle = true);

}  // namespace sightline
