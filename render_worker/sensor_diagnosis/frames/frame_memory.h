// SPDX-License-Identifier: Apache-2.0
// Dependence of a frame on the preceding frame.
#pragma once

#include <span>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Correlation of the noise of consecutive frames: frames are averaged, or signal is carried over
// after the electrons are counted. (Charge that stays in the pixel does not correlate noise, since
// every electron is in one frame only.) Needs steps of at least four frames. Material above 0.2 %.
Departure FrameCorrelation(std::span<const FlatFieldStatistics* const> steps);

// Difference between second and first frames of steps: charge lag after a change of the light, or a
// light source that warms up. Needs at least ten steps. Material above 0.1 %.
Departure FirstFrameDeficit(std::span<const FlatFieldStatistics* const> steps);

}  // namespace sightline
