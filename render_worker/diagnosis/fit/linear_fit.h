// SPDX-License-Identifier: Apache-2.0
// Linear least squares around a fit: how much a small change of the expectation improves chi
// squared after the fitted parameters have been refitted along with it.
//
// With the whitened Jacobian J and posterior information H = prior + J'J, the refitted parameters
// absorb J H^-1 J' d of a whitened change d. The rest is (I - J H^-1 J') d (Project).
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

class LinearFit {
 public:
  // Parameters at an active bound are fixed there (kFixed) or free (kReleased), because a new
  // effect may release them.
  enum class ActiveBounds { kFixed, kReleased };

  // `use_block`: observation blocks that count; empty: all. `fit` must outlive this.
  explicit LinearFit(const FitResult& fit, std::vector<bool> use_block = {},
                     ActiveBounds bounds = ActiveBounds::kFixed);

  // Whitened difference of an expectation from the fit's, the blocks one after the other; 0 for
  // those that do not count.
  Eigen::VectorXd Change(const BlockVectors& mean) const;
  const Eigen::VectorXd& residual() const { return residual_; }  // whitened

  // a' (I - J H^-1 J') b, the inner product of two whitened changes after refitting. A change d of
  // amplitude t lowers chi squared by 2 t Inner(r, d) - t^2 Inner(d, d), with the residual r.
  double Inner(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;
  // (I - J H^-1 J') d, so that Inner(a, b) = a . Project(b).
  Eigen::VectorXd Project(const Eigen::VectorXd& change) const;
  // H, the inverse of the parameters' posterior covariance.
  Eigen::MatrixXd information() const { return information_.reconstructedMatrix(); }
  // Gauss-Newton step from the fit's parameters to the optimum of the blocks that count, and the
  // residual there.
  Eigen::VectorXd Step() const;
  Eigen::VectorXd ResidualAtBest() const { return residual_ - jacobian_ * Step(); }

 private:
  // H^-1 J' d: how the standardised parameters move to absorb a change of the residual.
  Eigen::VectorXd Absorb(const Eigen::VectorXd& change) const;

  const FitResult& fit_;
  std::vector<bool> use_block_;
  std::vector<bool> fixed_;  // parameters that are fixed; empty: none
  Eigen::VectorXd residual_;
  Eigen::MatrixXd jacobian_;
  Eigen::LLT<Eigen::MatrixXd> information_;
};

}  // namespace sightline
