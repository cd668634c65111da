// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/significance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace sightline {
namespace {

TEST(Significance, GoldenValuesOfTheBound) {
  // Sellke, Bayarri and Berger (2001), table 1: the bound for p = 0.1, 0.05, 0.01 and 0.001.
  EXPECT_NEAR(1 / BayesFactorBound(0.1), 0.625, 2e-3);
  EXPECT_NEAR(1 / BayesFactorBound(0.05), 0.407, 5e-4);
  EXPECT_NEAR(1 / BayesFactorBound(0.01), 0.125, 5e-4);
  EXPECT_NEAR(1 / BayesFactorBound(0.001), 0.0188, 5e-5);
}

TEST(Significance, NoEvidenceAgainstAModelThatIsNotRejected) {
  EXPECT_EQ(BayesFactorBound(1), 1);
  EXPECT_EQ(BayesFactorBound(0.4), 1);
  EXPECT_TRUE(std::isfinite(BayesFactorBound(0)));
  EXPECT_NEAR(ProbabilityOfUnknown(1), 0.1, 1e-12);
}

TEST(Significance, GrowsAsThePValueFalls) {
  double before = 0;
  for (double p = 0.3; p > 1e-310; p /= 7) {
    const double probability = ProbabilityOfUnknown(p);
    EXPECT_GE(probability, before);
    EXPECT_LE(probability, 1);
    before = probability;
  }
  EXPECT_GT(before, 0.999);
}

}  // namespace
}  // namespace sightline
