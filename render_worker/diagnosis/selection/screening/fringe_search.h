// SPDX-License-Identifier: Apache-2.0
// Start values of straight fringes that stay on the sensor, from a periodogram over its rows and
// columns: a fit cannot move from one period to another.
#pragma once

#include <vector>

#include "render_worker/effects/effect.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// The few strongest waves in the laser recordings' relative residuals about the means of their
// rows: peaks of the periodogram of the region that most recordings show, refined by all regions,
// with one recording of each plate position. `effect` has StartSearch::kPeriodogramOfSensor; its
// parameters are relative amplitude, period [px], direction [deg] and phase [deg]. Empty: nothing
// is recorded.
std::vector<ActiveEffect> FringesSeen(const Effect& effect, const RecordedSet& set);

}  // namespace sightline
