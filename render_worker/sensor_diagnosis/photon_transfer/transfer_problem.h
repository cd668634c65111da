// SPDX-License-Identifier: Apache-2.0
// The photon transfer as a fit: observations chosen from the steps of a set, parameters with their
// scales and starting values.
#pragma once

#include <Eigen/Core>
#include <set>
#include <span>

#include "absl/status/statusor.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_model.h"

namespace sightline {

struct TransferData {
  std::span<const FlatFieldStatistics> steps;
  // Signal above the dark level at saturation [DN]; steps near it are left out.
  double saturation_signal_dn = 0;
  // Standard deviation of the black level from frame to frame [DN].
  double black_level_deviation_dn = 0;
  // Photons are stated; otherwise light is assumed to be proportional to the exposure time.
  bool has_photons = false;
  // Exposure times differ, so that dark current can be separated from the black level.
  bool fit_dark_current = true;
};

// Number of folds of the cross-validation; every fourth step is in the same one. Chosen.
inline constexpr int kTransferFolds = 4;

// The steps of a fit.
enum class FoldPart {
  kAll,
  kWithoutFold,  // all but those of the fold
  kFoldOnly,
};

struct TransferProblem {
  TransferObservations data;
  TransferLayout layout;
  Eigen::VectorXd start;  // in units of the layout's scales
};

// True if a step enters the fit: its signal is below 90 % of saturation and no pixel is clipped.
bool IsBelowSaturation(const FlatFieldStatistics& step, double dark_mean_dn,
                       double saturation_signal_dn);

// Scales and starting values come from all steps, so that parameters of all parts are comparable.
// `fold` in [0, kTransferFolds). FAILED_PRECONDITION: fewer than six bright steps below saturation,
// unless only the fold is requested.
absl::StatusOr<TransferProblem> MakeTransferProblem(const TransferData& transfer,
                                                    const std::set<TransferTerm>& terms,
                                                    FoldPart part, int fold = 0);

}  // namespace sightline
