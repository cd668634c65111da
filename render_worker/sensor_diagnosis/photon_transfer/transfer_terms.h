// SPDX-License-Identifier: Apache-2.0
// Forward selection of optional terms of the photon transfer by cross-validation, and the
// departures that they represent.
#pragma once

#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/sensor_diagnosis/departure.h"
#include "render_worker/sensor_diagnosis/photon_transfer/standard_values.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_fit.h"
#include "render_worker/sensor_diagnosis/sensor_frames.h"

namespace sightline {

struct TransferAnalysis {
  std::string undetermined;  // reason why there are no fits; empty if there are
  // The linear model, and the model with the selected terms.
  std::optional<TransferFit> linear, model;
  // Unset if a fold does not determine the parameters.
  std::optional<TransferPrediction> linear_prediction, model_prediction;
  std::vector<Departure> departures;
};

// Terms are added one by one, the most predictive first, as long as the log score of held-out steps
// rises by at least 3 nats. Each term that the set could show is then tested by the likelihood
// ratio against the model without it (Wilks). Errors of FitTransfer, except FAILED_PRECONDITION,
// which becomes `undetermined`.
absl::StatusOr<TransferAnalysis> AnalyseTransfer(const FlatFieldSteps& steps,
                                                 const Saturation& saturation);

}  // namespace sightline
