// SPDX-License-Identifier: Apache-2.0
// Where straight fringes that stay on the sensor show in recordings: a fit that starts elsewhere
// does not find them.
#pragma once

#include <vector>

#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// The strongest few waves in the laser recordings' relative residuals about the rows' means, as
// parameters of optics.cover_glass_etalon: peaks of the periodogram of the region that most
// recordings show, refined by all regions; one recording of each plate position. Empty: nothing is
// recorded.
std::vector<ActiveEffect> FringesSeen(const RecordedSet& set);

}  // namespace sightline
