// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/rounded_normal.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace sightline {
namespace {

TEST(RoundedNormal, WideNoiseOnlyGainsATwelfth) {
  for (const double mean : {20.0, 20.25, 20.5}) {
    const RoundedMoments moments = MomentsAfterRounding(mean, 1.2);
    EXPECT_NEAR(moments.mean, mean, 1e-9);
    EXPECT_NEAR(moments.variance, 1.44 + 1.0 / 12, 1e-7);
  }
}

// The first terms of the Fourier series (Widrow and Kollar, chapter 4).
TEST(RoundedNormal, AgreesWithTheFourierSeries) {
  const double sigma = 0.4, pi = std::numbers::pi;
  for (const double mean : {9.0, 9.1, 9.25, 9.5, 9.8}) {
    double error = 0, square = 0, slope = 0;
    for (int k = 1; k <= 8; ++k) {
      const double damping = (k % 2 == 1 ? -1 : 1) * std::exp(-2 * std::pow(pi * k * sigma, 2));
      error += damping * std::sin(2 * pi * k * mean) / (pi * k);
      square += damping * std::cos(2 * pi * k * mean) / std::pow(pi * k, 2);
      slope += 2 * damping * std::cos(2 * pi * k * mean);
    }
    const RoundedMoments moments = MomentsAfterRounding(mean, sigma);
    EXPECT_NEAR(moments.mean, mean + error, 1e-8) << mean;
    EXPECT_NEAR(moments.variance,
                sigma * sigma + 1.0 / 12 + square - error * error + 2 * sigma * sigma * slope, 1e-8)
        << mean;
  }
}

TEST(RoundedNormal, AgreesWithDrawnNumbersThatAreCutOffAtZero) {
  std::mt19937_64 random(7);
  for (const double mean : {0.1, 1.1, 1.5}) {
    std::normal_distribution<double> normal(mean, 0.3);
    constexpr int kDraws = 400000;
    double sums[5] = {};
    for (int i = 0; i < kDraws; ++i) {
      const double number = std::max(0.0, std::floor(normal(random) + 0.5));
      for (int k = 1; k <= 4; ++k) sums[k] += std::pow(number, k) / kDraws;
    }
    const double m = sums[1], variance = sums[2] - m * m;
    const double fourth = sums[4] - 4 * m * sums[3] + 6 * m * m * sums[2] - 3 * std::pow(m, 4);
    const RoundedMoments moments = MomentsAfterRounding(mean, 0.3);
    EXPECT_NEAR(moments.mean, m, 4 * std::sqrt(variance / kDraws));
    const double kurtosis = fourth / (variance * variance);
    EXPECT_NEAR(moments.variance, variance, 4 * variance * std::sqrt(kurtosis / kDraws));
    EXPECT_NEAR(moments.excess_kurtosis / (kurtosis - 3), 1, 0.1);
  }
}

// Numbers of a converter without its three lowest bits, at noise far below their step of 8.
TEST(RoundedNormal, AgreesWithDrawnNumbersWithoutTheirLowestBits) {
  std::mt19937_64 random(9);
  for (const double mean : {3.0, 7.2, 10.4, 15.9}) {
    std::normal_distribution<double> normal(mean, 1.1);
    constexpr int kDraws = 400000;
    double sum = 0, squares = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double number = std::max(0.0, std::floor(normal(random) + 0.5));
      const double cut = 8 * std::floor(number / 8);
      sum += cut / kDraws;
      squares += cut * cut / kDraws;
    }
    const double variance = squares - sum * sum;
    EXPECT_TRUE(IsCoarselyRounded(1.1, 8));
    const RoundedMoments moments = MomentsAfterRounding(mean, 1.1, 8);
    EXPECT_NEAR(moments.mean, sum, 5 * std::sqrt((variance + 1e-6) / kDraws)) << mean;
    EXPECT_NEAR(moments.variance, variance, 0.03 * variance + 0.01) << mean;
  }
}

}  // namespace
}  // namespace sightline
