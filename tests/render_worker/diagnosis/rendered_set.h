// SPDX-License-Identifier: Apache-2.0
// Small sets for the tests: a dozen plate positions, rendered with the full chain.
#pragma once

#include <vector>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// Nominal description: f-numbers, distances, exposures, a repeat, dark frames; 192 x 128 px.
RecordingSet SmallSetDescription();

// As recorded with these deviations and effects.
RecordedSet RenderSmallSet(const SetupDeviation& deviation,
                           const std::vector<ActiveEffect>& effects, uint64_t seed);

// Deviations of several quantities, within their uncertainties.
SetupDeviation SomeDeviations();

// The set's known parameters alone.
FitResult FitNull(const SetModel& model);

// Exposures of a rendered set count by the power 0.65 of their time, as films fail in reciprocity:
// no effect of the vocabulary does.
void FailInReciprocity(RecordedSet* set);

}  // namespace sightline
