// SPDX-License-Identifier: Apache-2.0
// Fits the parameters of a set's model to its recordings: first the deviations of the set-up within
// their stated uncertainties, then effects in addition.
//
// The fit is a maximum a posteriori estimate by Levenberg-Marquardt with finite differences. It
// minimises chi squared plus the penalty of the priors (fit_problem.h):
//   FitResult null = FitSet(model, start, {}, {}, nullptr);
//   FitResult with = FitSet(model, start_with_effects, FreeParameters(effects), settings, &null);
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "render_worker/diagnosis/fit/parameter_prior.h"
#include "render_worker/diagnosis/fit/parameter_vector.h"
#include "render_worker/diagnosis/fit/set_model.h"
#include "render_worker/diagnosis/fit/whitening.h"

namespace sightline {

struct FitSettings {
  // The covariance of the data is computed anew before each round. Fractions of the signal and of
  // the residual are added as standard deviations, so that a few precise components do not dominate
  // while the parameters are still far off. Empty: the covariance of `reference` is kept.
  struct Round {
    double of_signal = 0, of_residual = 0;
  };
  // Chosen: tolerances that shrink by a factor of 3 to 10, then two rounds with the model's own
  // covariance at the parameters found.
  std::vector<Round> rounds = {{0.1, 0.3}, {0.01, 0.1}, {0, 0}, {0, 0}};
  // Iterations of a round. Chosen: the derivatives date from the round's start, so that further
  // iterations gain little.
  int max_iterations = 4;
  // False: derivatives with respect to the set-up's parameters are kept from `reference`.
  bool renew_jacobian = true;
  // How often a round computes the derivatives again when its steps no longer lower the sum.
  int most_renewals = 0;
  // Derivatives with respect to the set-up's parameters are computed in the middle of the line
  // only. That is faster, but misses how far an effect and a deviation look alike elsewhere.
  bool middle_only = false;
  // Observation blocks to use; empty: all.
  std::vector<bool> use_block;
  // Data to explain; null: the model's recordings.
  const BlockVectors* observed = nullptr;
};

// Vectors and columns over parameters are in the order of ParameterVector.
struct FitResult {
  SetParameters parameters;
  std::vector<FreeEffectParameter> free;
  Eigen::VectorXd standardised;
  Eigen::VectorXd prior_weight;  // FitPriorWeight of each parameter, 1 for those of the set-up
  // True: the bound of the parameter is active; the data would move it further.
  std::vector<bool> at_bound;
  Eigen::MatrixXd covariance;                  // posterior covariance of `standardised`
  std::vector<double> effect_standard_errors;  // of `free`, in their units
  BlockVectors mean;                           // expectation
  std::shared_ptr<const Whitening> whitening;
  BlockVectors residual;                  // data minus expectation, whitened
  std::vector<Eigen::MatrixXd> jacobian;  // of the whitened expectation
  double chi_squared = 0;                 // of the blocks used
  int data_count = 0;                     // components of the blocks used
  double prior = 0;                       // sum of squares of the set-up's standardised parameters
  double data_log_determinant = 0;        // of the covariances of the blocks used
  double log_determinant = 0;             // of the posterior information matrix
  std::vector<double> block_chi_squared;  // of every block, used or not
  // Realised values of a random effect, as an effect that changes the expectation (random_effect);
  // null: none. They are contained in `mean` but not in `parameters`, whose last effect is the
  // distribution they were estimated under. The realised effect replaces that last effect, or
  // stands in addition to it where the distribution also describes variation that the realised
  // values do not (texture within segments along the line).
  std::shared_ptr<const Effect> random_effect;
  bool random_effect_is_additional = false;
};

// The parameters with which the model expects `fit.mean`: with the realised random effect. They
// point into `fit` and are valid as long as it lives.
SetParameters ParametersWithRandomEffect(const FitResult& fit);

// Twice the negative logarithm of the evidence in Laplace's approximation, without the terms that
// are equal for all fits of the same data:
//   chi squared + sum of z^2 + log |Sigma| + log |H|
// with the data's covariance Sigma and the posterior information H.
double TwiceCost(const FitResult& fit);

// `start` must place the line to within its width. `reference`: a fit of the same model with fewer
// free parameters, or null; it must be given where `settings` keep its covariance or Jacobian.
// Method: Levenberg-Marquardt (Marquardt, J. SIAM 11 (1963) 431) with a second-order correction
// (Nocedal and Wright, Numerical Optimization (2006), section 18.3).
FitResult FitSet(const SetModel& model, const SetParameters& start,
                 const std::vector<FreeEffectParameter>& free, const FitSettings& settings,
                 const FitResult* reference);

// The result of a fit that found `parameters` (without effects) in data equal to their expectation.
// It does not read recorded images.
FitResult LineariseSet(const SetModel& model, const SetParameters& parameters);

}  // namespace sightline
