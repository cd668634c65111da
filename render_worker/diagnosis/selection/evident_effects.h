// SPDX-License-Identifier: Apache-2.0
// Effects that raw numbers show by themselves, before any model is fitted.
#pragma once

#include <span>
#include <vector>

#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// The effects among `considered` that the raw numbers of `set` show beyond doubt, with their
// parameters: missing bits, where every number of every recording is a multiple of a power of two.
// A model comparison takes them for granted, since they change the covariance of all that it
// compares.
std::vector<ActiveEffect> EvidentEffects(const RecordedSet& set,
                                         std::span<const Effect* const> considered);

}  // namespace sightline
