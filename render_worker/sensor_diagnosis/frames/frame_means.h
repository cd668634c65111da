// SPDX-License-Identifier: Apache-2.0
// Changes of the mean of all pixels from frame to frame: flicker or drift of the light, noise or
// drift of the black level.
#pragma once

#include <span>
#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Standard deviation of the frame means from frame to frame over all given steps, without the part
// caused by temporal noise of the pixels [DN].
double DeviationOfFrameMeans(std::span<const FlatFieldStatistics* const> steps);

// Relative flicker and drift of the light in bright steps. Material: flicker above 0.1 %, drift
// over the longest series above 0.1 %.
std::vector<Departure> LightChanges(std::span<const FlatFieldStatistics* const> bright);

// Noise and drift of the black level [DN] in dark steps. Material above 0.1 DN.
std::vector<Departure> BlackLevelChanges(std::span<const FlatFieldStatistics* const> dark);

}  // namespace sightline
