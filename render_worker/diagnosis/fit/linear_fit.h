// SPDX-License-Identifier: Apache-2.0
// A fit's neighbourhood, linearised: what a small change of the expectation is worth after the
// parameters fitted have moved to absorb what they can of it.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

class LinearFit {
 public:
  // What a bound holds stays there, or is free: an effect may take over from it.
  enum class Held { kStays, kFree };

  // Entries not in `use_entry` (empty: all) count nothing.
  explicit LinearFit(const FitResult& fit, std::vector<bool> use_entry = {},
                     Held held = Held::kStays);

  // Whitened difference of an expectation from the fit's, all entries one after the other.
  Eigen::VectorXd Change(const Entries& mean) const;
  const Eigen::VectorXd& residual() const { return residual_; }  // whitened

  // Inner product of two whitened changes after the best parameters have been taken off both: chi
  // squared of residual r falls by 2 a Inner(r, d) - a^2 Inner(d, d) for a change a d.
  double Inner(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const;
  // The change without what the parameters absorb, so that Inner(a, b) = a . Project(b).
  Eigen::VectorXd Project(const Eigen::VectorXd& change) const;
  // Inverse of the parameters' posterior covariance, from the entries used.
  Eigen::MatrixXd information() const { return information_.reconstructedMatrix(); }
  // From the fit's parameters to the best ones for the entries used, and the residual there.
  Eigen::VectorXd Step() const;
  Eigen::VectorXd ResidualAtBest() const { return residual_ - jacobian_ * Step(); }

 private:
  // How the parameters (standardised) move to absorb a change of the residual.
  Eigen::VectorXd Absorb(const Eigen::VectorXd& change) const;

  const FitResult& fit_;
  std::vector<bool> use_entry_;
  std::vector<bool> held_;  // empty: nothing
  Eigen::VectorXd residual_;
  Eigen::MatrixXd jacobian_;
  Eigen::LLT<Eigen::MatrixXd> information_;
};

}  // namespace sightline
