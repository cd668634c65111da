// SPDX-License-Identifier: Apache-2.0
#include "core/statistics/order_statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

TEST(OrderStatistics, AreThoseOfTheSortedValues) {
  const std::vector<double> values = {7, -1, 3, 3, 12, 0.5, 2};
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  for (size_t rank = 0; rank < values.size(); ++rank) {
    EXPECT_EQ(OrderStatistic(values, rank), sorted[rank]);
  }
}

TEST(OrderStatistics, MedianIsTheUpperOfTwo) {
  EXPECT_EQ(UpperMedian(std::vector{5}), 5);
  EXPECT_EQ(UpperMedian(std::vector{5, 1}), 5);
  EXPECT_EQ(UpperMedian(std::vector{5, 1, 4}), 4);
  EXPECT_EQ(UpperMedian(std::vector{5, 1, 4, 2}), 4);
}

TEST(OrderStatistics, QuantilesReachTheEnds) {
  const std::vector<float> values = {4, 2, 1, 3, 0};
  EXPECT_EQ(LowerQuantile(values, 0), 0);
  EXPECT_EQ(LowerQuantile(values, 0.49), 1);
  EXPECT_EQ(LowerQuantile(values, 0.5), 2);
  EXPECT_EQ(LowerQuantile(values, 1), 4);
}

// The spread of rounded normal numbers by their quartiles. Linear interpolation takes the density
// to be even within a whole number, so that it is off by a fifth of one at most; whole quartiles
// state 0.74 for a spread of 1.45.
TEST(OrderStatistics, QuantilesBeforeRoundingAreThoseOfTheDistribution) {
  for (const double mean : {7.0, 7.25, 7.5}) {
    for (const double deviation : {0.7, 1.0, 1.45, 2.2, 5.0}) {
      CounterRandom random(3, 0);
      std::vector<int> values;
      for (int i = 0; i < 40000; ++i) {
        values.push_back(static_cast<int>(std::lround(mean + deviation * random.Normal())));
      }
      std::sort(values.begin(), values.end());
      const double quartiles =
          QuantileBeforeRounding(values, 0.75) - QuantileBeforeRounding(values, 0.25);
      EXPECT_NEAR(quartiles / 1.349, deviation, 0.2) << mean;
      EXPECT_NEAR(QuantileBeforeRounding(values, 0.5), mean, 0.2) << deviation;
    }
  }
  EXPECT_EQ(QuantileBeforeRounding(std::vector{4, 4, 4, 4}, 0.5), 4);
}

}  // namespace
}  // namespace sightline
