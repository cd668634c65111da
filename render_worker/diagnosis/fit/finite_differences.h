// SPDX-License-Identifier: Apache-2.0
// Jacobian of a fit's whitened expectation by finite differences.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/fit/fit_problem.h"

namespace sightline {

// First step, standardised. Chosen: a twentieth of the prior's standard deviation shows the slope
// of a smooth model far above rounding.
inline constexpr double kFirstStep = 0.05;

// One matrix per observation block: derivatives of its whitened expectation, a column per
// standardised parameter.
using FitJacobian = std::vector<Eigen::MatrixXd>;

// Step lengths adapt and are kept from one Jacobian to the next. The first step is a fixed length;
// later ones are such that the whitened expectation changes by one standard deviation. Parameters
// with the same effect on the data are thus moved by the same amount, and curvature does not make
// their columns look different.
class FiniteDifferences {
 public:
  // `problem` must outlive this.
  explicit FiniteDifferences(const FitProblem& problem);

  // The Jacobian at a state whose residual is known. `known`: a Jacobian whose columns before the
  // first effect parameter are kept, or null. All line shifts are moved at once, because an
  // observation block depends on the shift of its own plate position only. Parameters that only
  // change the amount of laser light share one difference.
  FitJacobian At(const FitState& state, const FitJacobian* known);

 private:
  void DifferentiateSetup(const FitState& state, FitJacobian& jacobian);
  void Differentiate(const FitState& state, const BlockVectors& origin, bool middle_only, int i,
                     FitJacobian& jacobian, int attempt = 0);
  // Adapts the step length of parameter i to the column's squared norm; true: differentiate again.
  bool AdaptStep(int i, double step, double square);
  int ColumnOf(int i, int block) const;
  double LogLightStep(const FitState& state, int i) const;

  const FitProblem& problem_;
  Eigen::VectorXd steps_;  // per parameter, standardised
};

}  // namespace sightline
