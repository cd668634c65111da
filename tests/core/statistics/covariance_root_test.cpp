// SPDX-License-Identifier: Apache-2.0
#include "core/statistics/covariance_root.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

// Four variables with units from micrometres to hundreds, made of `errors` independent ones.
Eigen::MatrixXd CovarianceOf(Eigen::Index errors, uint64_t seed) {
  CounterRandom random(seed, 0);
  Eigen::MatrixXd of_errors(4, errors);
  for (double& x : of_errors.reshaped()) x = random.Normal();
  const Eigen::VectorXd units = Eigen::Vector4d(1e-6, 1, 1e-3, 300);
  of_errors = (units.asDiagonal() * of_errors).eval();
  return of_errors * of_errors.transpose();
}

TEST(CovarianceRoot, GivesTheCovarianceAndHasTheColumnsOfItsRank) {
  for (const Eigen::Index rank : {1, 2, 3, 4}) {
    const Eigen::MatrixXd covariance = CovarianceOf(rank, 40 + static_cast<uint64_t>(rank));
    const Eigen::MatrixXd root = CovarianceRoot(covariance);
    EXPECT_EQ(root.cols(), rank);
    const Eigen::MatrixXd product = root * root.transpose();
    for (Eigen::Index i = 0; i < 4; ++i) {
      for (Eigen::Index j = 0; j < 4; ++j) {
        EXPECT_NEAR(product(i, j), covariance(i, j),
                    1e-10 * std::sqrt(covariance(i, i) * covariance(j, j)))
            << i << ", " << j;
      }
    }
  }
}

TEST(CovarianceRoot, VariablesWithoutVarianceGetZeros) {
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(3, 3);
  covariance(0, 0) = 4;
  covariance(2, 2) = -1e-20;  // rounding
  const Eigen::MatrixXd root = CovarianceRoot(covariance);
  ASSERT_EQ(root.cols(), 1);
  EXPECT_NEAR(std::abs(root(0, 0)), 2, 1e-12);
  EXPECT_EQ(root(1, 0), 0);
  EXPECT_EQ(root(2, 0), 0);
  EXPECT_EQ(CovarianceRoot(Eigen::MatrixXd::Zero(5, 5)).cols(), 0);
}

}  // namespace
}  // namespace sightline
