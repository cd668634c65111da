// SPDX-License-Identifier: Apache-2.0
#include "core/statistics/normal_distribution.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sightline {
namespace {

// Abramowitz and Stegun, Handbook of Mathematical Functions, table 26.1 and 26.2.
TEST(NormalDistribution, HasTheTabulatedValues) {
  EXPECT_NEAR(NormalDistribution(0), 0.5, 1e-15);
  EXPECT_NEAR(NormalDistribution(1), 0.841344746068543, 1e-14);
  EXPECT_NEAR(NormalUpperTail(3), 1.349898031630095e-3, 1e-16);
  EXPECT_NEAR(NormalTwoSidedTail(-2), 0.0455002638963584, 1e-15);
  EXPECT_NEAR(NormalDensity(1), 0.241970724519143, 1e-14);
}

TEST(NormalDistribution, QuantilesInvertProbabilities) {
  for (const double x : {-6.0, -2.5, -0.1, 0.0, 0.7, 3.0}) {
    EXPECT_NEAR(NormalQuantile(NormalDistribution(x)), x, 1e-7) << x;
  }
  for (const double z : {0.0, 0.3, 1.959963984540054, 8.0, 30.0}) {
    EXPECT_NEAR(NormalTwoSidedQuantile(NormalTwoSidedTail(z)), z, 1e-9) << z;
  }
}

// Far below the least double the density of the tail is left: d/dx log Phi = phi / Phi ~ -x.
TEST(NormalDistribution, LogarithmGoesOnWhereTheProbabilityIsZero) {
  EXPECT_NEAR(LogOfNormalDistribution(-1), std::log(0.158655253931457), 1e-13);
  EXPECT_NEAR(LogOfNormalDistribution(-30.0001), LogOfNormalDistribution(-29.9999) - 30 * 2e-4,
              2e-3);
  EXPECT_NEAR(LogOfNormalDistribution(-60), -1800 - std::log(60) - 0.918938533204673, 1e-9);
}

}  // namespace
}  // namespace sightline
