// SPDX-License-Identifier: Apache-2.0
// Temporal noise common to several pixels: of a row or column, or neighbours.
#pragma once

#include <span>
#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Temporal noise common to all pixels of a row or of a column in dark steps. Material above 1 % of
// the pixels' variance.
std::vector<Departure> LineNoiseDepartures(std::span<const FlatFieldStatistics* const> dark);

// Covariance of the noise of neighbouring pixels as a quadratic function of the signal. Constant
// part: readout. Linear part: coupling after the electrons are counted, such as interpixel
// capacitance (diffusing electrons stay independent). Quadratic part: brighter-fatter effect
// (charge repels charge). `signal_dn`: above the dark level, one per step. Material above a
// correlation of 0.2 %.
std::vector<Departure> NeighbourDepartures(std::span<const FlatFieldStatistics* const> steps,
                                           std::span<const double> signal_dn);

}  // namespace sightline
