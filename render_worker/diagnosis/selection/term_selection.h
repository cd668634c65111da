// SPDX-License-Identifier: Apache-2.0
// Which coefficients of a free-form term a set of recordings asks for.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "render_worker/effects/effect.h"

namespace sightline {

// Logarithm of the prior density of a standardised parameter over that of a normal one at its
// middle: a Cauchy law, half of all rigs within one scale; of half the line where a parameter has
// one sign. Where it may be any of several decades (EffectParameter::decades), even in its
// logarithm over these (Jeffreys, Theory of Probability, 3rd ed., section 3.1); values that are not
// told from 0 count as `standard_error` (of the standardised parameter) away from it.
double LogParameterPrior(const EffectParameter& parameter, double standardised,
                         double standard_error);

// Logarithm of the prior probability of `needed` coefficients of `all`: every number of them is as
// likely as any other, and so are all choices of as many. 1 <= needed <= all.
double LogSelectionPrior(int needed, int all);

struct TermSelection {
  std::vector<bool> needed;      // of the coefficients
  Eigen::VectorXd standardised;  // all parameters, with the others of the coefficients at 0
  // Of the logarithm of the evidence, with the prior of the selection for both, over all
  // coefficients; 0: all are needed.
  double log_evidence_gain = 0;
};

// The choice of `coefficients` (of these parameters, at these indices into `standardised`) that has
// the largest evidence, in the normal approximation around a fit: `standardised` and their
// posterior `covariance` (n x n), in which they have normal priors around 0 with variances of 1 /
// `prior_weight`. At least one stays; at most 16. Laplace's approximation: MacKay, Information
// Theory, Inference, and Learning Algorithms (2003), chapter 28.
TermSelection SelectCoefficients(const Eigen::VectorXd& standardised,
                                 const Eigen::MatrixXd& covariance,
                                 const Eigen::VectorXd& prior_weight,
                                 std::span<const int> coefficients,
                                 std::span<const EffectParameter> parameters);

}  // namespace sightline
