// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/term_selection.h"

#include <Eigen/Cholesky>
#include <cassert>
#include <cmath>
#include <numbers>

namespace sightline {

double LogParameterPrior(const EffectParameter& parameter, double standardised,
                         double standard_error) {
  const double sides = parameter.lower == parameter.null_value ? 1 : 2;
  double density = 2 / (sides * std::numbers::pi * (1 + standardised * standardised));
  if (parameter.decades > 0) {
    const double least = std::pow(10, -parameter.decades);
    const double mass = std::log1p(1 / least) + 1 / (1 + least);
    const double z = std::hypot(standardised, standard_error);
    density = 1 / (sides * mass * (z < 1 ? z + least : (1 + least) * z * z));
  }
  return std::log(density) + 0.5 * std::log(2 * std::numbers::pi);
}

double LogSelectionPrior(int needed, int all) {
  assert(1 <= needed && needed <= all);
  return -std::log(all) - std::lgamma(all + 1.0) + std::lgamma(needed + 1.0) +
         std::lgamma(all - needed + 1.0);
}

TermSelection SelectCoefficients(const Eigen::VectorXd& standardised,
                                 const Eigen::MatrixXd& covariance,
                                 const Eigen::VectorXd& prior_weight,
                                 std::span<const int> coefficients,
                                 std::span<const EffectParameter> parameters) {
  assert(coefficients.size() == parameters.size() && coefficients.size() <= 16);
  const int n = static_cast<int>(coefficients.size());
  const auto log_priors = [&](const Eigen::VectorXd& values, unsigned dropped) {
    double sum = 0;
    for (int k = 0; k < n; ++k) {
      if ((dropped >> k & 1U) == 0)
        sum += LogParameterPrior(parameters[k], values[coefficients[k]],
                                 std::sqrt(covariance(coefficients[k], coefficients[k])));
    }
    return sum;
  };
  const auto square = [&](const Eigen::VectorXd& values) {
    double sum = 0;
    for (const int i : coefficients) sum += prior_weight[i] * values[i] * values[i];
    return sum;
  };
  TermSelection best{std::vector<bool>(n, true), standardised, 0};
  const double log_priors_of_all = log_priors(standardised, 0) + LogSelectionPrior(n, n);
  for (unsigned dropped = 1; dropped + 1 < 1U << n; ++dropped) {
    std::vector<int> at;
    for (int k = 0; k < n; ++k) {
      if ((dropped >> k & 1U) != 0) at.push_back(coefficients[k]);
    }
    const Eigen::LLT<Eigen::MatrixXd> theirs(covariance(at, at));
    const Eigen::VectorXd weighed = theirs.solve(standardised(at));
    Eigen::VectorXd moved = standardised - covariance(Eigen::all, at) * weighed;
    moved(at).setZero();
    // Removes the fit's normal priors; the evidence contains LogParameterPrior instead.
    const double chi_squared =
        standardised(at).dot(weighed) - (square(moved) - square(standardised));
    const double log_determinant = 2 * theirs.matrixLLT().diagonal().array().log().sum();
    const double gain = -0.5 * (chi_squared + log_determinant) + log_priors(moved, dropped) +
                        LogSelectionPrior(n - static_cast<int>(at.size()), n) - log_priors_of_all;
    if (!(gain > best.log_evidence_gain)) continue;
    for (int k = 0; k < n; ++k) best.needed[k] = (dropped >> k & 1U) == 0;
    best.standardised = std::move(moved);
    best.log_evidence_gain = gain;
  }
  return best;
}

}  // namespace sightline
