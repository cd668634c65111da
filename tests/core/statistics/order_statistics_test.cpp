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

// The spread of rounded normal numbers by their quartiles; whole quartiles would give 0.74 or 1.48.
TEST(OrderStatistics, QuantilesBeforeRoundingAreThoseOfTheDistribution) {
  CounterRandom random(3, 0);
  for (const double deviation : {0.7, 1.0, 1.45, 2.2, 5.0}) {
    std::vector<int> values;
    for (int i = 0; i < 40000; ++i) {
      values.push_back(static_cast<int>(std::lround(7.5 + deviation * random.Normal())));
    }
    std::sort(values.begin(), values.end());
    const double quartiles =
        QuantileBeforeRounding(values, 0.75) - QuantileBeforeRounding(values, 0.25);
    EXPECT_NEAR(quartiles / 1.349, deviation, 0.05 * deviation);
    EXPECT_NEAR(QuantileBeforeRounding(values, 0.5), 7.5, 0.05 * deviation);
  }
  EXPECT_EQ(QuantileBeforeRounding(std::vector{4, 4, 4, 4}, 0.5), 4);
}

}  // namespace
}  // namespace sightline
