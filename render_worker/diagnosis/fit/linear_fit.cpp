// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/linear_fit.h"

#include <utility>

namespace sightline {

LinearFit::LinearFit(const FitResult& fit, std::vector<bool> use_block, ActiveBounds bounds)
    : fit_(fit), use_block_(std::move(use_block)) {
  if (bounds == ActiveBounds::kFixed) fixed_ = fit.at_bound;
  Eigen::Index size = 0;
  for (const Eigen::VectorXd& residual : fit.residual) size += residual.size();
  residual_.setZero(size);
  jacobian_.setZero(size, fit.standardised.size());
  Eigen::Index at = 0;
  for (size_t e = 0; e < fit.residual.size(); ++e) {
    const Eigen::Index n = fit.residual[e].size();
    if (use_block_.empty() || use_block_[e]) {
      residual_.segment(at, n) = fit.residual[e];
      jacobian_.middleRows(at, n) = fit.jacobian[e];
    }
    at += n;
  }
  for (size_t i = 0; i < fixed_.size(); ++i) {
    if (fixed_[i]) jacobian_.col(static_cast<Eigen::Index>(i)).setZero();
  }
  Eigen::MatrixXd information = fit.prior_weight.asDiagonal();
  information.noalias() += jacobian_.transpose() * jacobian_;
  information_.compute(information);
}

Eigen::VectorXd LinearFit::Change(const BlockVectors& mean) const {
  Eigen::VectorXd change = Eigen::VectorXd::Zero(residual_.size());
  Eigen::Index at = 0;
  for (size_t e = 0; e < mean.size(); ++e) {
    const Eigen::Index n = mean[e].size();
    if (use_block_.empty() || use_block_[e]) {
      change.segment(at, n) = (*fit_.whitening)(static_cast<int>(e), mean[e] - fit_.mean[e]);
    }
    at += n;
  }
  return change;
}

Eigen::VectorXd LinearFit::Absorb(const Eigen::VectorXd& change) const {
  return information_.solve(jacobian_.transpose() * change);
}

Eigen::VectorXd LinearFit::Step() const {
  Eigen::VectorXd gradient =
      jacobian_.transpose() * residual_ - fit_.prior_weight.cwiseProduct(fit_.standardised);
  for (size_t i = 0; i < fixed_.size(); ++i) {
    if (fixed_[i]) gradient[static_cast<Eigen::Index>(i)] = 0;
  }
  return information_.solve(gradient);
}

Eigen::VectorXd LinearFit::Project(const Eigen::VectorXd& change) const {
  return change - jacobian_ * Absorb(change);
}

double LinearFit::Inner(const Eigen::VectorXd& a, const Eigen::VectorXd& b) const {
  const Eigen::VectorXd ja = jacobian_.transpose() * a;
  const Eigen::VectorXd jb = jacobian_.transpose() * b;
  return a.dot(b) - ja.dot(information_.solve(jb));
}

}  // namespace sightline
