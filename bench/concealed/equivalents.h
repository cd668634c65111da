// SPDX-License-Identifier: Apache-2.0
// The effects that the recordings of a set cannot tell from a given one.
#pragma once

#include <string>
#include <vector>

#include "core/sensor/sensor.h"
#include "render_worker/effects/effect.h"

namespace sightline::bench {

// Ids that count as right for reasons of physics alone, whatever was recorded, besides the effect
// itself: factors that enter only as a product (reflectance, power, transmission, quantum
// efficiency of all colours), bending responses, incoherent sums of speckle patterns.
std::vector<std::string> PhysicallyEquivalent(const ActiveEffect& effect, const Sensor& camera);

}  // namespace sightline::bench
