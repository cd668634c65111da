// SPDX-License-Identifier: Apache-2.0
// Priors of effects' parameters, and the choice of those coefficients of a model-discrepancy term
// that a set of recordings supports.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "render_worker/effects/effect.h"

namespace sightline {

// Logarithm of the prior density p(z) of a standardised parameter z over the standard normal
// density at 0. The prior is a Cauchy distribution, half of it within one scale; it is doubled on
// one side if the null value is the lower bound. With EffectParameter::decades > 0 the prior is
// uniform in log z over these decades (Jeffreys, Theory of Probability, 3rd ed., section 3.1), and
// z counts as hypot(z, `standard_error`), since a value below its error cannot be known to be that
// small.
double LogParameterPrior(const EffectParameter& parameter, double standardised,
                         double standard_error);

// Logarithm of the prior probability that exactly these `needed` of `all` coefficients are not 0:
// every number of them is equally probable, and so are all choices of that number.
// 1 <= needed <= all.
double LogSelectionPrior(int needed, int all);

struct TermSelection {
  std::vector<bool> needed;      // of the coefficients
  Eigen::VectorXd standardised;  // all parameters, with coefficients that are not needed at 0
  // Gain in evidence over all coefficients, with the priors of both choices [nats]; 0: all are
  // needed.
  double log_evidence_gain = 0;
};

// The choice of `coefficients` of largest evidence, in the normal approximation around a fit with
// n `standardised` parameters and their posterior `covariance` (n x n). The fit's priors are normal
// around 0 with variances 1 / `prior_weight`. `coefficients` are indices into `standardised`,
// `parameters` their descriptions in the same order; at most 16, since all choices are evaluated.
// At least one coefficient stays. Source: MacKay, Information Theory, Inference, and Learning
// Algorithms (2003), chapter 28.
TermSelection SelectCoefficients(const Eigen::VectorXd& standardised,
                                 const Eigen::MatrixXd& covariance,
                                 const Eigen::VectorXd& prior_weight,
                                 std::span<const int> coefficients,
                                 std::span<const EffectParameter> parameters);

}  // namespace sightline
