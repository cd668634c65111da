// SPDX-License-Identifier: Apache-2.0
// Changes of the mean of all pixels from frame to frame: light that flickers or drifts, a black
// level that wanders.
#pragma once

#include <span>
#include <vector>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Standard deviation of the frame means from frame to frame over all given steps, less the part
// that temporal noise of the pixels causes [DN].
double DeviationOfFrameMeans(std::span<const FlatFieldStatistics* const> steps);

// Flicker and drift of the light, relative, of bright steps.
// Material: flicker from 0.1 % on, drift over the longest series from 0.1 % on.
std::vector<Departure> LightChanges(std::span<const FlatFieldStatistics* const> bright);

// Noise and drift of the black level [DN], of dark steps. Material from 0.1 DN on.
std::vector<Departure> BlackLevelChanges(std::span<const FlatFieldStatistics* const> dark);

}  // namespace sightline
