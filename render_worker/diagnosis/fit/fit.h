// SPDX-License-Identifier: Apache-2.0
// Fits the parameters of a set's model to its recordings: nominal values within their uncertainties
// first, effects on top.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <memory>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// A parameter of an effect that is fitted; others of the effect stay as they are.
struct FreeEffectParameter {
  int effect = 0;     // index into SetParameters::effects
  int parameter = 0;  // index into its parameters
};

// Values of a parameter that is tried, not fitted: missing bits, blades. Empty: it is fitted.
std::vector<double> WholeNumbers(const EffectParameter& parameter);
// All that are fitted.
std::vector<FreeEffectParameter> FreeParameters(const std::vector<ActiveEffect>& effects);

// Scale on which a parameter is fitted and its prior is standard normal around the null value:
// logarithmic where the null value is a typical value of a positive quantity.
double StandardisedParameter(const EffectParameter& parameter, double value);
double ParameterFromStandardised(const EffectParameter& parameter, double standardised);

// The prior of an effect's standardised parameter while it is fitted: normal within one scale,
// Cauchy's tails beyond, so that a strong effect is not pulled towards none. Twice its negative
// logarithm less that at 0, and the weight w with which its derivative is 2 w z.
double FitPenalty(double standardised);
double FitPriorWeight(double standardised);

// Square roots of the inverse covariances of a model's entries.
class Whitening {
 public:
  // `unexplained`: standard deviations added to every number, or empty.
  Whitening(const std::vector<Eigen::MatrixXd>& covariance, const Entries& unexplained);
  // Logarithm of the determinant of an entry's covariance.
  double LogDeterminant(int entry) const {
    return 2 * factors_[entry].matrixLLT().diagonal().array().log().sum();
  }
  Eigen::VectorXd operator()(int entry, const Eigen::VectorXd& difference) const {
    return factors_[entry].matrixL().solve(difference);
  }

 private:
  std::vector<Eigen::LLT<Eigen::MatrixXd>> factors_;
};

struct FitSettings {
  // Rounds: before each the data's covariance is renewed, with these fractions of the signal and of
  // what is unexplained as further standard deviations, so that a start far off is not held by a
  // few precise numbers. Empty: the covariance of `reference` is kept.
  struct Round {
    double of_signal = 0, of_residual = 0;
  };
  std::vector<Round> rounds = {{0.1, 0.3}, {0.01, 0.1}, {0, 0}, {0, 0}};
  int max_iterations = 4;      // a round
  bool renew_jacobian = true;  // of the deviations; false: that of `reference` is kept
  int most_renewals = 0;       // of the derivatives where steps help no more, in a round
  // Derivatives with respect to the deviations from the middle of the line only: faster, but what
  // an effect and a deviation do alike is taken for different.
  bool middle_only = false;
  // Entries to use; empty: all.
  std::vector<bool> use_entry;
  // What is to be explained; null: the model's recordings.
  const Entries* observed = nullptr;
};

struct FitResult {
  SetParameters parameters;
  std::vector<FreeEffectParameter> free;
  // Standardised: deviations over their uncertainties, line shifts over theirs, errors of the
  // model, effects' parameters. Columns of the Jacobian are in this order.
  Eigen::VectorXd standardised;
  Eigen::VectorXd prior_weight;  // inverse variances of their priors: 1, or less of strong effects
  std::vector<bool> held;        // at a bound that the data would go beyond
  Eigen::MatrixXd covariance;    // posterior, of `standardised`
  std::vector<double> effect_standard_errors;  // of `free`, in their units
  Entries mean;                                // expected
  std::shared_ptr<const Whitening> whitening;
  Entries residual;                       // observed minus expected, whitened
  std::vector<Eigen::MatrixXd> jacobian;  // of the expectation, whitened
  double chi_squared = 0;                 // of the data that was used
  int data_count = 0;
  double prior = 0;                       // sum of squared standardised parameters but the effects'
  double data_log_determinant = 0;        // of the covariances of the data that was used
  double log_determinant = 0;             // of the information matrix with the priors
  std::vector<double> entry_chi_squared;  // also of entries not used
  // What recordings or places have drawn (random_effect), in `mean` but not in `parameters`, whose
  // last effect is the law it is drawn by: an effect that takes that one's place, or stands besides
  // it where the law says more of a recording than what was drawn (texture within blocks). Null:
  // nothing.
  std::shared_ptr<const Effect> drawn;
  bool drawn_besides_law = false;
};

// The parameters of what a fit expects of these very recordings: with what they have drawn. Valid
// as long as `fit`.
SetParameters ParametersAsDrawn(const FitResult& fit);

// Twice the negative logarithm of the evidence, but for constants: compares fits of the same data,
// each under a covariance of its own.
double TwiceCost(const FitResult& fit);

// `from` with deviations, line shifts and errors of the model as `standardised` (first as in
// FitResult), within their bounds.
SetParameters AtStandardised(const SetModel& model, const SetParameters& from,
                             const Eigen::VectorXd& standardised);

// Levenberg-Marquardt with finite differences; `start` must have the line to within its width.
// `reference`: a fit of the same model with fewer free parameters, or null.
FitResult FitSet(const SetModel& model, const SetParameters& start,
                 const std::vector<FreeEffectParameter>& free, const FitSettings& settings,
                 const FitResult* reference);

// The result of a fit that found `parameters` (without effects) in data that meets its expectation
// exactly: nothing recorded is looked at.
FitResult LineariseSet(const SetModel& model, const SetParameters& parameters);

}  // namespace sightline
