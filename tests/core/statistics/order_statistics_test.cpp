// SPDX-License-Identifier: Apache-2.0
#include "core/statistics/order_statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

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

}  // namespace
}  // namespace sightline
