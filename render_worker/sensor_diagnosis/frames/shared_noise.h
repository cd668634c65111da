// SPDX-License-Identifier: Apache-2.0
// Temporal noise that pixels share: all of a row or column, or neighbours.
#pragma once

#include <span>
#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Temporal noise that all pixels of a row or of a column have in common, of dark steps. Material
// from 1 % of the pixels' variance on.
std::vector<Departure> LineNoiseDepartures(std::span<const FlatFieldStatistics* const> dark);

// Covariance of the noise of neighbouring pixels as a quadratic of the signal: a constant part
// (readout); a part in proportion to the signal (coupling after the electrons are counted, such as
// interpixel capacitance; diffusing electrons stay independent); a part in proportion to its square
// (brighter-fatter effect: charge repels charge). `signal_dn`: above the dark level, one a step.
// Material from a correlation of 0.2 % on.
std::vector<Departure> NeighbourDepartures(std::span<const FlatFieldStatistics* const> steps,
                                           std::span<const double> signal_dn);

}  // namespace sightline
