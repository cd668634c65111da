// SPDX-License-Identifier: Apache-2.0
// Covariance of adjusted parameters when residuals of one block are correlated.
//
// (J'J)^-1 assumes independent residuals. In an image of a target they are not independent: a wrong
// distortion model, a bent plate or light from the side moves all corners or the whole line. The
// scatter of the blocks' scores shows such common errors (cluster-robust covariance: Liang and
// Zeger, Biometrika 73(1), 1986), here as the jackknife over blocks, whose bias is small for few
// blocks (Bell and McCaffrey, Survey Methodology 28(2), 2002). Few blocks determine a covariance of
// many parameters badly, so it is shrunk towards a multiple of the one for independent residuals
// (Ledoit and Wolf, J. Multivariate Analysis 88(2), 2004).
#pragma once

#include <Eigen/Core>

#include "core/block_adjustment/block_adjustment.h"

namespace sightline {

// Covariance of the shared parameters, in no direction smaller than `solution.shared_covariance`.
// Fewer than three blocks give that covariance itself.
Eigen::MatrixXd CovarianceBetweenBlocks(const BlockSolution& solution);

}  // namespace sightline
