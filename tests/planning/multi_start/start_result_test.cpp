// SPDX-License-Identifier: Apache-2.0
// Tests the choice of the best of several searches.
#include "planning/multi_start/start_result.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/random/random.h"

namespace sightline {
namespace {

// Every scan costs 1 unless `cost` says otherwise.
StartResult Start(int64_t seed, StopReason reason, int scans, double satisfied, double cost = -1) {
  StartResult start;
  start.seed = seed;
  start.stop_reason = reason;
  start.scans.resize(static_cast<size_t>(scans));
  start.satisfied = satisfied;
  start.cost = cost < 0 ? scans : cost;
  return start;
}

TEST(StartResultTest, FewestScansThenMostSettledThenLowestSeed) {
  constexpr auto kReached = StopReason::kGoalReached;
  EXPECT_TRUE(IsBetterStart(Start(9, kReached, 4, 0.95), Start(1, kReached, 5, 0.99)));
  EXPECT_TRUE(IsBetterStart(Start(9, kReached, 4, 0.97), Start(1, kReached, 4, 0.96)));
  EXPECT_TRUE(IsBetterStart(Start(1, kReached, 4, 0.96), Start(9, kReached, 4, 0.96)));
  EXPECT_FALSE(IsBetterStart(Start(9, kReached, 4, 0.96), Start(1, kReached, 4, 0.96)));
}

TEST(StartResultTest, LessTimeToExecuteComesBeforeFewerScans) {
  constexpr auto kReached = StopReason::kGoalReached;
  EXPECT_TRUE(IsBetterStart(Start(9, kReached, 5, 0.95, 2400), Start(1, kReached, 4, 0.95, 4700)));
  EXPECT_TRUE(IsBetterStart(Start(9, kReached, 4, 0.95, 2400), Start(1, kReached, 5, 0.99, 2400)));
  constexpr auto kStalled = StopReason::kStalled;
  EXPECT_TRUE(IsBetterStart(Start(9, kStalled, 5, 0.8, 2400), Start(1, kStalled, 4, 0.8, 4700)));
  EXPECT_FALSE(IsBetterStart(Start(9, kStalled, 5, 0.7, 2400), Start(1, kStalled, 4, 0.8, 4700)));
}

// A plan that gave up early has few scans too.
TEST(StartResultTest, ReachingTheGoalComesFirst) {
  for (const StopReason reason : {StopReason::kMaxScans, StopReason::kMaxTime, StopReason::kStalled,
                                  StopReason::kInterrupted}) {
    const StartResult short_of_it = Start(1, reason, 2, 0.9);
    const StartResult reached = Start(2, StopReason::kGoalReached, 7, 0.9);
    EXPECT_TRUE(IsBetterStart(reached, short_of_it));
    EXPECT_FALSE(IsBetterStart(short_of_it, reached));
  }
  // If no start reaches the goal, the satisfied fraction counts more than the number of scans.
  EXPECT_TRUE(IsBetterStart(Start(2, StopReason::kStalled, 7, 0.8),
                            Start(1, StopReason::kStalled, 2, 0.7)));
  EXPECT_TRUE(IsBetterStart(Start(2, StopReason::kStalled, 2, 0.8),
                            Start(1, StopReason::kMaxScans, 7, 0.8)));
}

// The same one is the best, whichever of them ends first.
TEST(StartResultTest, OrdersResultsStrictly) {
  Random random(5);
  std::vector<StartResult> starts;
  for (int seed = 0; seed < 60; ++seed) {
    starts.push_back(
        Start(seed, random.Below(2) == 0 ? StopReason::kGoalReached : StopReason::kStalled,
              1 + static_cast<int>(random.Below(4)), 0.1 * static_cast<double>(random.Below(4)),
              static_cast<double>(random.Below(3))));
  }
  for (const StartResult& a : starts) {
    for (const StartResult& b : starts) {
      const int wins = (IsBetterStart(a, b) ? 1 : 0) + (IsBetterStart(b, a) ? 1 : 0);
      EXPECT_EQ(wins, a.seed == b.seed ? 0 : 1) << a.seed << " " << b.seed;
      for (const StartResult& c : starts) {
        EXPECT_TRUE(IsBetterStart(a, c) || !IsBetterStart(a, b) || !IsBetterStart(b, c));
      }
    }
  }
}

}  // namespace
}  // namespace sightline
