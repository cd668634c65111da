// SPDX-License-Identifier: Apache-2.0
// Test of reciprocity: the same light in a shorter or longer time gives the same signal.
#pragma once

#include <span>

#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_fit.h"

namespace sightline {

// Regression of the relative residuals of `model` on the logarithm of the exposure time: the signal
// of the same light goes with the time to the power of the slope. Not testable if exposure times do
// not differ, or only together with the light. Material from an exponent of 0.001 on. `steps`:
// those that the model was fitted to.
Departure ReciprocityFailure(std::span<const FlatFieldStatistics> steps, const TransferFit& model);

}  // namespace sightline
