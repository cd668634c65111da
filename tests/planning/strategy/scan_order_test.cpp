// SPDX-License-Identifier: Apache-2.0
#include "planning/strategy/scan_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "planning/optimise/search_space.h"
#include "tests/planning/analytic_gain_model.h"

namespace sightline {
namespace {

CostModel Costs() {
  CostModel costs;
  costs.reposition_time_s = 2;
  costs.reposition_speed_rad_per_s = 0.5;
  costs.reposition_speed_m_per_s = 0.1;
  return costs;
}

std::vector<Measurement> RandomScans(int count, uint64_t seed) {
  const SearchSpace space(NineParameterDomain());
  Random random(seed);
  std::vector<Measurement> scans;
  for (int i = 0; i < count; ++i) {
    std::vector<double> x(9);
    for (double& coordinate : x) coordinate = random.Uniform();
    scans.push_back(space.ToMeasurement(x));
  }
  return scans;
}

TEST(ScanOrderTest, RepositioningIsTheFixedTimePlusTheSlowerMotion) {
  Measurement a, b;
  b.offset_y_m = a.offset_y_m + 0.3;
  b.part_gamma_rad = a.part_gamma_rad + 1;
  EXPECT_NEAR(RepositionTimeS(ExecutionModel{Costs()}, a, b), 2 + 3,
              1e-12);  // 0.3 m at 0.1 m/s; 1 rad takes 2 s
  b.part_gamma_rad = a.part_gamma_rad + 2;
  EXPECT_NEAR(RepositionTimeS(ExecutionModel{Costs()}, a, b), 2 + 4, 1e-12);
  // The short way round.
  b.part_gamma_rad = a.part_gamma_rad + 6;
  EXPECT_NEAR(RepositionTimeS(ExecutionModel{Costs()}, a, b), 2 + 3, 1e-12);
  EXPECT_EQ(RepositionTimeS(ExecutionModel{CostModel{}}, a, b), 0);
}

TEST(ScanOrderTest, ScanTimeFollowsTheSlowerOfStageAndCamera) {
  CostModel costs;
  EXPECT_EQ(ScanTimeS(costs, 0.001, 0, 400), 0);
  costs.stage_speed_m_per_s = 0.2;
  EXPECT_NEAR(ScanTimeS(costs, 0.001, 0, 400), 2, 1e-12);
  costs.frame_rate_hz = 100;  // 0.1 m/s
  EXPECT_NEAR(ScanTimeS(costs, 0.001, -100, 300), 4, 1e-12);
  EXPECT_EQ(ScanTimeS(costs, 0.001, 0, -1), 0);
}

TEST(ScanOrderTest, DynamicProgrammingEqualsBruteForce) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    for (int locked : {0, 1, 3}) {
      const auto scans = RandomScans(7, seed);
      const std::vector<int> order = OrderScans(ExecutionModel{Costs()}, scans, locked);
      for (int i = 0; i < locked; ++i) EXPECT_EQ(order[i], i);
      std::vector<int> trial(7);
      std::iota(trial.begin(), trial.end(), 0);
      double best = 1e300;
      do {
        best = std::min(best, TotalRepositionTimeS(ExecutionModel{Costs()}, scans, trial));
      } while (std::next_permutation(trial.begin() + locked, trial.end()));
      EXPECT_NEAR(TotalRepositionTimeS(ExecutionModel{Costs()}, scans, order), best, 1e-9);
    }
  }
}

TEST(ScanOrderTest, LocalSearchFindsAnOrderAlongALine) {
  // Scans along a line in random order: the best path goes from end to end.
  std::vector<Measurement> scans(20);
  Random random(4);
  for (Measurement& scan : scans) scan.offset_y_m = random.Uniform() - 0.5;
  const std::vector<int> order = OrderScans(ExecutionModel{Costs()}, scans);
  double least = 1, most = -1;
  for (const Measurement& scan : scans) {
    least = std::min(least, scan.offset_y_m);
    most = std::max(most, scan.offset_y_m);
  }
  EXPECT_NEAR(TotalRepositionTimeS(ExecutionModel{Costs()}, scans, order),
              19 * 2 + (most - least) / 0.1, 1e-9);
}

TEST(ScanOrderTest, CostsWithoutMotionKeepTheOrder) {
  const auto scans = RandomScans(5, 1);
  CostModel costs;
  EXPECT_EQ(OrderScans(ExecutionModel{costs}, scans), (std::vector<int>{0, 1, 2, 3, 4}));
  costs.reposition_time_s = 3;
  EXPECT_EQ(OrderScans(ExecutionModel{costs}, scans), (std::vector<int>{0, 1, 2, 3, 4}));
  EXPECT_TRUE(OrderScans(ExecutionModel{Costs()}, {}).empty());
}

}  // namespace
}  // namespace sightline
