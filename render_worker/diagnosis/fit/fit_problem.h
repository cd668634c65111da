// SPDX-License-Identifier: Apache-2.0
// The sum that a fit minimises, over standardised parameters z:
//   F(z) = sum over blocks e of |L_e^-1 (y_e - mu_e(z))|^2 + penalty(z)
// with the data y, the model's expectation mu, the Cholesky factor L of each observation block's
// covariance (Whitening) and the penalty of the priors (ParameterVector).
#pragma once

#include <Eigen/Core>
#include <memory>
#include <utility>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

// The sum and its parts at one point z.
struct FitState {
  Eigen::VectorXd x;       // standardised parameters
  BlockVectors mean;       // expectation
  BlockVectors residual;   // whitened difference of the data from the expectation
  double chi_squared = 0;  // of the blocks that the fit uses
  double total = 0;        // F
};

class FitProblem {
 public:
  // `model` must outlive the problem, and so must FitSettings::observed.
  FitProblem(const SetModel& model, const SetParameters& start,
             const std::vector<FreeEffectParameter>& free, const FitSettings& settings)
      : model_(model), vector_(model, start, free), settings_(settings) {}

  const SetModel& model() const { return model_; }
  const ParameterVector& vector() const { return vector_; }
  const FitSettings& settings() const { return settings_; }
  const std::shared_ptr<const Whitening>& whitening() const { return whitening_; }
  void set_whitening(std::shared_ptr<const Whitening> whitening) {
    whitening_ = std::move(whitening);
  }
  const BlockVectors& Observed() const {
    return settings_.observed != nullptr ? *settings_.observed : model_.observed();
  }
  bool Used(size_t block) const {
    return settings_.use_block.empty() || settings_.use_block[block];
  }

  // Computes expectation and covariance at the state and makes the latter the data's, widened by
  // the round's fractions of signal and residual. The sum is not compared yet.
  void RenewCovariance(const FitSettings::Round& round, FitState& state);
  // Sets residual and sums of a state whose expectation is known.
  void Compare(FitState& state) const;
  // The state at x, moved within the bounds.
  FitState At(const Eigen::VectorXd& x) const;
  // Sum of the log-determinants of the covariances of the blocks used.
  double LogDeterminant() const;

 private:
  const SetModel& model_;
  ParameterVector vector_;
  FitSettings settings_;
  std::shared_ptr<const Whitening> whitening_;
};

}  // namespace sightline
