// SPDX-License-Identifier: Apache-2.0
// Forward selection of the terms that extend the linear photon transfer, by cross-validation, and
// the departures that the terms stand for.
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
  std::string undetermined;  // why there are no fits; empty: there are
  // The linear model, and with the selected terms.
  std::optional<TransferFit> linear, model;
  // Unset if a fold does not determine the parameters.
  std::optional<TransferPrediction> linear_prediction, model_prediction;
  std::vector<Departure> departures;
};

// Terms are added one by one, the one that predicts best first, as long as the log score over left
// out steps rises by at least 3 nats. Each term that the set could show is then tested by the
// likelihood ratio against the model without it (Wilks). Errors: those of FitTransfer other than
// FAILED_PRECONDITION, which is the answer's `undetermined`.
absl::StatusOr<TransferAnalysis> AnalyseTransfer(const FlatFieldSteps& steps,
                                                 const Saturation& saturation);

}  // namespace sightline
