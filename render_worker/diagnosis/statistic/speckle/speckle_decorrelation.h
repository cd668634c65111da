// SPDX-License-Identifier: Apache-2.0
// Decorrelation of speckle between two recordings of the same plate position.
#pragma once

#include <span>

#include "render_worker/diagnosis/expectation/expected_frame.h"

namespace sightline {

// Mean squared change of the pixels between two recordings of the same speckle over twice its
// variance: 1 minus their correlation, for the movements that the effects cause between or during
// the recordings. The loss of contrast within each exposure is accounted for. 0 without effects or
// without laser light.
double SpeckleDecorrelation(const ExpectedFrame& a, const ExpectedFrame& b,
                            std::span<const ActiveEffect> effects);

}  // namespace sightline
