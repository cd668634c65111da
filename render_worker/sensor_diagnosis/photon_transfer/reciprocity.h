// SPDX-License-Identifier: Apache-2.0
// Test of reciprocity: the same photons in a shorter or longer time give the same signal.
#pragma once

#include <span>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_fit.h"

namespace sightline {

// Regression of the relative residuals of `model` on the logarithm of the exposure time: for the
// same light, the signal is proportional to the time to the power of the slope. Not testable if
// exposure times are equal or vary only together with the light. Material above an exponent of
// 0.001. `steps`: those that the model was fitted to.
Departure ReciprocityFailure(std::span<const FlatFieldStatistics> steps, const TransferFit& model);

}  // namespace sightline
