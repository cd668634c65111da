// SPDX-License-Identifier: Apache-2.0
// Displacement and blur of every recording by itself, with hardly any prior. A strong movement is
// seen in every recording; a wrong distribution of the movements would keep the linearisation point
// where that distribution expects it.
#pragma once

#include <vector>

#include "render_worker/diagnosis/random_effect/linearised_set.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

namespace sightline {

// One per recording with laser light, in order. `linear`: linearised for Amplitude::kShift.
std::vector<RecordedMovement> FreeMovements(const LinearisationBasis& basis,
                                            const LinearisedSet& linear);

// The set linearised about its free movements, in three steps of at most half a pixel each.
LinearisedSet LineariseAboutFreeMovements(const LinearisationBasis& basis, LinearisedSet linear);

}  // namespace sightline
