// SPDX-License-Identifier: Apache-2.0
// Broyden's rank-one update of a Jacobian, so that it need not be computed again at every step.
#pragma once

#include <Eigen/Core>

namespace sightline {

// Corrects `jacobian` (m x n) so that it maps `moves` (n) to the observed `change` (m).
// BlockVectors that are zero stay zero (Schubert, Math. Comp. 24 (1970) 27).
void UpdateDerivatives(const Eigen::VectorXd& moves, const Eigen::VectorXd& change,
                       Eigen::MatrixXd& jacobian);

}  // namespace sightline
