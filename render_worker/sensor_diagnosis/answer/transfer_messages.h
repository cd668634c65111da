// SPDX-License-Identifier: Apache-2.0
// Converts fits and points of the photon transfer to messages.
#pragma once

#include "render_worker/sensor_diagnosis/photon_transfer/standard_values.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_terms.h"
#include "render_worker/sensor_diagnosis/sensor_frames.h"
#include "sightline/v1/sensor_set.pb.h"

namespace sightline {

// Sets `linear_fit`, `model_fit` and `photon_transfer`: the fitted steps with light in their order,
// then the saturated ones. `analysis` must have fits.
void AddTransferMessages(const TransferAnalysis& analysis, const FlatFieldSteps& steps,
                         const Saturation& saturation, v1::SensorDiagnosis* answer);

}  // namespace sightline
