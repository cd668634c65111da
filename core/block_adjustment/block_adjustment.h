// SPDX-License-Identifier: Apache-2.0
// Least squares over parameters that all blocks of observations share and parameters of single
// blocks (bundle adjustment), by Levenberg and Marquardt with central differences.
//
// In a calibration a block is a frame: its own parameters are the pose of the target, the shared
// ones camera, laser plane and shape of the target.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct BlockProblem {
  // Residuals of block k, each divided by its standard deviation, for shared and own parameters.
  std::function<Eigen::VectorXd(int block, const Eigen::VectorXd& shared,
                                const Eigen::VectorXd& own)>
      residuals;
  Eigen::VectorXd shared;            // start
  std::vector<Eigen::VectorXd> own;  // start, one per block; may be of length 0
  Eigen::VectorXd shared_step;       // steps of the differences, positive
  double own_step = 1e-6;            // the same of every own parameter
  // Prior standard deviations of the shared parameters about their start: 0 fixes a parameter,
  // infinity is uninformative.
  Eigen::VectorXd prior_standard_deviation;
};

struct BlockSolution {
  Eigen::VectorXd shared;
  std::vector<Eigen::VectorXd> own;
  // Covariance of the shared parameters if all residuals are independent: (J'J)^-1 with the own
  // parameters eliminated. Rows of fixed parameters are 0.
  Eigen::MatrixXd shared_covariance;
  // Per block, with its own parameters eliminated: information about the shared parameters J'J and
  // score J'r, both without priors. Both are 0 for fixed parameters.
  std::vector<Eigen::MatrixXd> block_information;
  std::vector<Eigen::VectorXd> block_score;
  double sum_of_squares = 0;  // of the residuals, without priors
  int residual_count = 0, parameter_count = 0;
};

// INVALID_ARGUMENT: the observations do not determine the parameters, or residuals are not finite.
absl::StatusOr<BlockSolution> AdjustBlocks(const BlockProblem& problem);

}  // namespace sightline
