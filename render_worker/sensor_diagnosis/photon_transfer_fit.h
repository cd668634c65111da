// SPDX-License-Identifier: Apache-2.0
// Maximum likelihood of the photon transfer: means and temporal variances of all steps below
// saturation against the linear model of EMVA 1288 (Release 4.0 Linear, section 2) and what may
// extend it. With e = eta p + I t electrons in a step of p photons and t seconds:
//
//   mean      y = y_0 + K g(e),   g(e) = e (1 + b_2 u + b_3 u^2),  u = e / e_saturation
//   variance  s = (K g'(e))^2 (e (1 - c u) + sigma_d^2) + 1/12
//
// and p (1 + t_0 / t) + p_0 instead of p, if exposure times are off by t_0 or stray light adds p_0
// photons. Light and variance may differ from step to step by relative standard deviations s_L and
// s_V beyond temporal noise; they are fitted, too, so the likelihood contains log|Sigma|.
#pragma once

#include <Eigen/Core>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// What may extend the linear model.
enum class TransferTerm {
  kQuadraticResponse,   // b_2
  kCubicResponse,       // b_3
  kBrighterFatter,      // c: charge pushes charge into neighbours, so that variance falls short
  kExposureTimeOffset,  // t_0
  kStrayLight,          // p_0, of bright frames only
};

struct TransferParameter {
  std::string name, unit;
  double value = 0, standard_error = 0;
};

// One mean and one variance of a step, with their model.
struct TransferPoint {
  size_t step = 0;  // of the statistics given
  double mean_dn = 0, mean_standard_error_dn = 0, expected_mean_dn = 0;
  double variance_dn2 = 0, variance_standard_error_dn2 = 0, expected_variance_dn2 = 0;
};

struct TransferFit {
  std::vector<TransferParameter> parameters;  // s_L and s_V last
  std::vector<TransferPoint> points;
  double log_likelihood = 0;  // with -log|Sigma|/2, without the constant
  double chi_squared = 0;
  int degrees_of_freedom = 0;

  // The parameter's value; 0 if the model does not have it.
  double Value(const std::string& name) const;
  const TransferParameter* Find(const std::string& name) const;
};

struct TransferData {
  std::vector<FlatFieldStatistics> steps;
  // Signal above the dark level that the largest step used has; saturated steps are left out.
  double saturation_signal_dn = 0;
  // Standard deviation of what is read as black level from frame to frame [DN].
  double black_level_scatter_dn = 0;
  // Photons are given; else light is taken to be proportional to the exposure time.
  bool has_photons = false;
  // Exposure times differ, so that dark current can be told from the black level.
  bool fit_dark_current = true;
};

// Steps that enter the fit: signal below `largest_share` of saturation, no pixel clipped.
bool IsBelowSaturation(const FlatFieldStatistics& step, double dark_mean_dn,
                       double saturation_signal_dn);

// FAILED_PRECONDITION: fewer than six bright steps below saturation, or parameters that the steps
// do not determine.
absl::StatusOr<TransferFit> FitTransfer(const TransferData& data,
                                        const std::set<TransferTerm>& terms);

struct TransferPrediction {
  double log_score = 0;    // log density of all numbers, every fold predicted by the others [nats]
  double chi_squared = 0;  // with the errors of the prediction
  int numbers = 0;
};
// Four folds, every fourth step in each.
absl::StatusOr<TransferPrediction> PredictTransfer(const TransferData& data,
                                                   const std::set<TransferTerm>& terms);

}  // namespace sightline
