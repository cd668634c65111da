// SPDX-License-Identifier: Apache-2.0
// Root of a covariance: independent errors that together have it.
#pragma once

#include <Eigen/Core>

namespace sightline {

// L with L L' = C, without columns for directions of no variance, so that a vector of as many
// independent standard normal numbers gives errors L x with the covariance C. Taken from the
// correlations, because variables' units may differ by orders of magnitude. `covariance`: n x n,
// finite and symmetric; variances that rounding has made negative count as 0. Eigenvalues of the
// correlation below 1e-12 n are rounding and count as 0.
Eigen::MatrixXd CovarianceRoot(const Eigen::MatrixXd& covariance);

}  // namespace sightline
