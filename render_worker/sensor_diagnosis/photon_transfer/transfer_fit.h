// SPDX-License-Identifier: Apache-2.0
// Maximum likelihood of the photon transfer: means and temporal variances of all steps below
// saturation against the model of transfer_model.h, and cross-validation of its terms.
//
// Means y_i and variances s_i are independent and normal with the standard deviations of
// StandardDeviations. Relative standard deviations between steps of light, s_L, and of variance,
// s_V, are estimated, too, so that the likelihood contains log|Sigma|:
//   log L = -1/2 sum_i r_i^2 - sum_i log sigma_i,  r_i = (y_i - E y_i) / sigma_i.
#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_problem.h"

namespace sightline {

struct TransferParameter {
  std::string name, unit;
  double value = 0, standard_error = 0;
};

// Mean and variance of one step with their model.
struct TransferPoint {
  size_t step = 0;  // index of the set's step
  double mean_dn = 0, mean_standard_error_dn = 0, expected_mean_dn = 0;
  double variance_dn2 = 0, variance_standard_error_dn2 = 0, expected_variance_dn2 = 0;
};

struct TransferFit {
  std::vector<TransferParameter> parameters;  // s_L and s_V last
  std::vector<TransferPoint> points;
  double log_likelihood = 0;  // without the constant [nats]
  double chi_squared = 0;
  int degrees_of_freedom = 0;

  // The parameter's value; 0 if the model lacks it.
  double Value(const std::string& name) const;
  // Returns nullptr if the model lacks it.
  const TransferParameter* Find(const std::string& name) const;
};

// FAILED_PRECONDITION: fewer than six bright steps below saturation, parameters that the steps do
// not determine, or no convergence.
absl::StatusOr<TransferFit> FitTransfer(const TransferData& data,
                                        const std::set<TransferTerm>& terms);

struct TransferPrediction {
  double log_score = 0;    // log density of all numbers, each fold predicted by the others [nats]
  double chi_squared = 0;  // with the errors of the prediction
  int numbers = 0;
};

// Cross-validation over kTransferFolds folds. Predictive variances are 1 + J C J^T in units of
// sigma_i^2, with the covariance C of the fitted parameters and their derivatives J. Errors as
// FitTransfer.
absl::StatusOr<TransferPrediction> PredictTransfer(const TransferData& data,
                                                   const std::set<TransferTerm>& terms);

}  // namespace sightline
