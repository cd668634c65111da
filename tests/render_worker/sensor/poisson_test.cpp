// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/poisson.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/render_worker/sensor/chi_squared.h"

namespace sightline {
namespace {

TEST(LogFactorial, AgreesWithTheLibrary) {
  for (double k : {0.0, 1.0, 2.0, 14.0, 15.0, 16.0, 17.0, 100.0, 12345.0, 1e8}) {
    EXPECT_NEAR(LogFactorial(k), std::lgamma(k + 1), 1e-14 * std::lgamma(k + 1) + 1e-15) << k;
  }
}

// Ten means; one of them fails by chance in one of 1000 choices of seeds.
class PoissonLaw : public ::testing::TestWithParam<double> {};

TEST_P(PoissonLaw, HistogramHasThePoissonLaw) {
  const double mean = GetParam();
  constexpr int kDraws = 1000000;
  const int last = static_cast<int>(mean + 8 * std::sqrt(mean) + 20);
  std::vector<double> counts(last + 1), expected(last + 1);
  for (int i = 0; i < kDraws; ++i) {
    CounterRandom random(42, i);
    const double k = PoissonNumber(mean, random);
    ASSERT_EQ(k, std::floor(k));
    ASSERT_GE(k, 0);
    ASSERT_LE(k, last);
    ++counts[static_cast<int>(k)];
  }
  for (int k = 0; k <= last; ++k) {
    expected[k] = kDraws * std::exp(k * std::log(mean) - mean - std::lgamma(k + 1.0));
  }
  EXPECT_GT(GoodnessOfFit(counts, expected), 1e-4);
}

INSTANTIATE_TEST_SUITE_P(Means, PoissonLaw,
                         ::testing::Values(0.1, 1, 5, 9.999, 10, 12.3, 31, 300, 5000, 33456));

TEST(PoissonNumber, MomentsOfLargeMeans) {
  for (const double mean : {1e6, 4e8}) {
    constexpr int kDraws = 100000;
    double sum = 0, sum2 = 0;
    for (int i = 0; i < kDraws; ++i) {
      CounterRandom random(7, i);
      const double d = (PoissonNumber(mean, random) - mean) / std::sqrt(mean);
      sum += d;
      sum2 += d * d;
    }
    EXPECT_NEAR(sum / kDraws, 0, 4 / std::sqrt(kDraws)) << mean;
    EXPECT_NEAR(sum2 / kDraws, 1, 4 * std::sqrt(2.0 / kDraws)) << mean;
  }
}

TEST(PoissonNumber, ZeroMeanIsZero) {
  CounterRandom random(1, 1);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(PoissonNumber(0, random), 0);
}

}  // namespace
}  // namespace sightline
