// Small sets for the tests: a dozen plate positions, rendered with the full chain.
#pragma once

#include <vector>

#include "render_worker/diagnosis/recorded_set.h"
#include "render_worker/effects/effect.h"

namespace sightline {

// Nominal description: f-numbers, distances, exposures, a repeat, dark frames; 192 x 128 px.
RecordingSet SmallSetDescription();

// As recorded with these deviations and effects.
RecordedSet RenderSmallSet(const SetupDeviation& deviation,
                           const std::vector<ActiveEffect>& effects, uint64_t seed);

}  // namespace sightline
