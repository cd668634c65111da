// SPDX-License-Identifier: Apache-2.0
// Searches the parameters of one effect with the largest gain by coarse evaluations of the model:
// linear steps from the null values, shapes named by its description, larger steps both ways, and
// values beyond a threshold.
#pragma once

#include <vector>

#include "render_worker/diagnosis/selection/screening/screening.h"

namespace sightline {

// `starts`: parameters of `effect` that are evaluated first. The gain of a change d of the whitened
// expectation is r . d - <d, d> / 2 [nats], r the whitened residual and <,> the inner product of
// LinearFit::Inner.
ScreenedEffect SearchEffect(const Screening& screening, const Effect& effect,
                            const std::vector<ActiveEffect>& starts);

}  // namespace sightline
