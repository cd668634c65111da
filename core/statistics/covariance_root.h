// SPDX-License-Identifier: Apache-2.0
// Root of a covariance: represents correlated errors by independent ones.
#pragma once

#include <Eigen/Core>

namespace sightline {

// L with L L' = C, without columns for directions of zero variance: errors L x have the covariance
// C if the elements of x are independent standard normal numbers. Computed from the correlation
// matrix, because units of variables may differ by orders of magnitude. `covariance`: n x n, finite
// and symmetric; variances that rounding has made negative count as 0. Eigenvalues of the
// correlation matrix below 1e-12 n are rounding and count as 0.
Eigen::MatrixXd CovarianceRoot(const Eigen::MatrixXd& covariance);

}  // namespace sightline
