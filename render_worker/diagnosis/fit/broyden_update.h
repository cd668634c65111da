// SPDX-License-Identifier: Apache-2.0
// Derivatives that follow what was seen, so that they need not be computed anew at every step.
#pragma once

#include <Eigen/Core>

namespace sightline {

// Broyden's update: derivatives bent to the `change` that was seen when the parameters moved by
// `moves`. Derivatives that are zero stay so (Schubert, Math. Comp. 24, 1970, 27-30).
void UpdateDerivatives(const Eigen::VectorXd& moves, const Eigen::VectorXd& change,
                       Eigen::MatrixXd& jacobian);

}  // namespace sightline
