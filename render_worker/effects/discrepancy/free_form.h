// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms: one for each way in which a stage of the chain could differ from its
// model, with a few coefficients in which the image is linear near 0. They stand for physics that
// the vocabulary lacks.
//
// They are effects like those of the vocabulary (fitted, rendered, ordered the same way). A
// diagnosis considers them as unknown physics and writes them, fitted, among the calibrated
// effects; renderers find them by their id.
#pragma once

#include <span>
#include <string_view>

#include "render_worker/effects/effect.h"

namespace sightline {

// All terms, in the order in which they act if several are used. Ids are "unknown.response", ...
// Null is 0 for every coefficient.
std::span<const Effect* const> FreeFormTerms();
// Returns nullptr if no term has that id.
const Effect* FindFreeFormTerm(std::string_view id);

}  // namespace sightline
