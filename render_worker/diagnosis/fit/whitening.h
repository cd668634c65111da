// SPDX-License-Identifier: Apache-2.0
// Whitening transform: differences between recordings and model become independent numbers of unit
// variance, whose sum of squares is chi squared.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/fit/set_model.h"

namespace sightline {

// With the Cholesky factor L of an observation block's covariance, L L' = Sigma, the whitened
// difference is L^-1 d. Blocks are independent of each other.
class Whitening {
 public:
  // `covariance`: one positive definite matrix per observation block. `unexplained`: standard
  // deviations that are added to every component of every block, or empty.
  Whitening(const std::vector<Eigen::MatrixXd>& covariance, const BlockVectors& unexplained);

  // Logarithm of the determinant of a block's covariance.
  double LogDeterminant(int block) const {
    return 2 * factors_[block].matrixLLT().diagonal().array().log().sum();
  }
  Eigen::VectorXd operator()(int block, const Eigen::VectorXd& difference) const {
    return factors_[block].matrixL().solve(difference);
  }
  // The inverse of it, L w, column by column.
  Eigen::MatrixXd Coloured(int block, const Eigen::MatrixXd& whitened) const {
    return factors_[block].matrixL() * whitened;
  }
  Eigen::MatrixXd Covariance(int block) const { return factors_[block].reconstructedMatrix(); }

 private:
  std::vector<Eigen::LLT<Eigen::MatrixXd>> factors_;
};

}  // namespace sightline
