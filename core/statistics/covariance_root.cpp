// SPDX-License-Identifier: Apache-2.0
#include "core/statistics/covariance_root.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace sightline {

Eigen::MatrixXd CovarianceRoot(const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = covariance.rows();
  if (n == 0) return {};
  const Eigen::VectorXd deviation = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const Eigen::VectorXd inverse = deviation.unaryExpr([](double s) { return s > 0 ? 1 / s : 0; });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(inverse.asDiagonal() * covariance *
                                                             inverse.asDiagonal());
  // Eigenvalues rise; those of a correlation add up to its size.
  const double least = 1e-12 * static_cast<double>(n);
  Eigen::Index kept = 0;
  while (kept < n && eigen.eigenvalues()[n - 1 - kept] > least) ++kept;
  return deviation.asDiagonal() * eigen.eigenvectors().rightCols(kept) *
         eigen.eigenvalues().tail(kept).cwiseSqrt().asDiagonal();
}

}  // namespace sightline
