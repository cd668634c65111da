// SPDX-License-Identifier: Apache-2.0
// Effects that are evident from raw values before any model is fitted.
#pragma once

#include <span>
#include <vector>

#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// The effects among `considered` that are certain from the raw values of `set`, with their
// parameters: missing bits, if every value of every recording is a multiple of a power of two.
// A model comparison contains them in all hypotheses, since they change the covariance of
// each.
std::vector<ActiveEffect> EvidentEffects(const RecordedSet& set,
                                         std::span<const Effect* const> considered);

}  // namespace sightline
