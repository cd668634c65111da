// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/exposure_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>
#include <vector>

namespace sightline {
namespace {

// Falls to a flat bottom and rises: like the cost of exposures, with its least place anywhere.
class Valleys : public ::testing::TestWithParam<std::tuple<double, bool>> {};
TEST_P(Valleys, SearchFindsTheGridsOptimum) {
  const auto [best_s, equal_ratios] = GetParam();
  const ExposureGrid grid{2e-4, 2e-2, 300, equal_ratios};
  const double least_s = best_s;
  const auto cost = [least_s](double t) {
    return 0.3 + std::pow(std::log(t / least_s), 2) / (1 + t);
  };
  int asked = 0;
  const CostsOfExposures costs = [&](std::span<const int> indices) {
    std::vector<double> answers;
    for (const int index : indices) answers.push_back(cost(grid.At(index)));
    asked += static_cast<int>(indices.size());
    return answers;
  };
  const auto found = SearchExposure(grid, false, costs);
  ASSERT_TRUE(found.ok());
  EXPECT_LE(asked, 30);
  const auto all = SearchExposure(grid, true, costs);
  ASSERT_TRUE(all.ok());
  // The next grid point, or one whose time differs by less than 3 %.
  EXPECT_TRUE(std::abs(*found - *all) <= 1 ||
              std::abs(std::log(grid.At(*found) / grid.At(*all))) < 0.03)
      << *found << " " << *all;
  EXPECT_LE(cost(grid.At(*found)), cost(grid.At(*all)) + 1e-3);
}
INSTANTIATE_TEST_SUITE_P(Places, Valleys,
                         ::testing::Combine(::testing::Values(1e-4, 2e-4, 3.1e-4, 9e-4, 2.7e-3,
                                                              9e-3, 1.9e-2, 0.1),
                                            ::testing::Bool()));

TEST(ExposureSearch, NothingIsAskedTwice) {
  std::vector<int> times(50);
  const auto found =
      SearchExposure({1e-3, 1e-2, 50, false}, false, [&](std::span<const int> indices) {
        std::vector<double> answers;
        for (const int index : indices) {
          ++times[static_cast<size_t>(index)];
          answers.push_back(std::abs(index - 17));
        }
        return answers;
      });
  ASSERT_TRUE(found.ok());
  EXPECT_EQ(*found, 17);
  for (const int count : times) EXPECT_LE(count, 1);
}

TEST(ExposureSearch, ErrorsArePassedOn) {
  EXPECT_EQ(SearchExposure({1e-3, 1e-2, 50, false}, false,
                           [](std::span<const int>) -> absl::StatusOr<std::vector<double>> {
                             return absl::CancelledError("stop");
                           })
                .status()
                .code(),
            absl::StatusCode::kCancelled);
}

// Thesis eq. 6.4: the same exposures at every f-number.
TEST(ExposureGrid, KeepsTheExposure) {
  const ExposureGrid at_2_8 = AtFNumber({0.2e-3, 12e-3, 300, false}, 1.4, 2.8);
  EXPECT_DOUBLE_EQ(at_2_8.min_s, 0.8e-3);
  EXPECT_DOUBLE_EQ(at_2_8.max_s, 48e-3);
}

TEST(ExposureGrid, NearestIsTheInverse) {
  for (const bool equal_ratios : {false, true}) {
    const ExposureGrid grid{2e-4, 2e-2, 100, equal_ratios};
    for (int i = 0; i < grid.count; ++i) EXPECT_EQ(grid.Nearest(grid.At(i)), i);
    EXPECT_EQ(grid.Nearest(1e-9), 0);
    EXPECT_EQ(grid.Nearest(1), 99);
  }
}

TEST(ExposureLimit, IsFrameTimeOrMotionBlur) {
  CostModel costs;
  OpticsPlanning planning;
  planning.max_motion_blur_px = 0.5;
  EXPECT_FALSE(LimitExposure(costs, 1e-3, planning, 5000).longest_s.has_value());
  costs.frame_rate_hz = 50;
  const ExposureLimit frame = LimitExposure(costs, 1e-3, planning, 0);
  EXPECT_DOUBLE_EQ(*frame.longest_s, 0.02);
  EXPECT_DOUBLE_EQ(frame.stage_speed_m_per_s, 0.05);
  // 0.05 m/s times 5000 px/m: half a pixel in 2 ms.
  EXPECT_DOUBLE_EQ(*LimitExposure(costs, 1e-3, planning, 5000).longest_s, 0.002);
  costs.stage_speed_m_per_s = 0.01;
  EXPECT_DOUBLE_EQ(*LimitExposure(costs, 1e-3, planning, 5000).longest_s, 0.01);
  planning.cost_px_per_s = 0.1;
  EXPECT_FALSE(LimitExposure(costs, 1e-3, planning, 5000).longest_s.has_value());
}

TEST(ScanTime, LongExposuresSlowTheStage) {
  CostModel costs;
  costs.stage_speed_m_per_s = 0.05;
  OpticsPlanning planning;
  EXPECT_DOUBLE_EQ(ScanTime(costs, 1e-3, planning, 0, 0.2, 0.001), 4);
  // 40 ms per frame of 1 mm: 25 mm/s.
  EXPECT_DOUBLE_EQ(ScanTime(costs, 1e-3, planning, 0, 0.2, 0.04), 8);
  // Half a pixel in 1 ms at 5000 px/m: 100 mm/s; in 10 ms 10 mm/s.
  EXPECT_DOUBLE_EQ(ScanTime(costs, 1e-3, planning, 5000, 0.2, 0.01), 20);
  EXPECT_EQ(ScanTime({}, 1e-3, planning, 5000, 0.2, 0.01), 0);
}

}  // namespace
}  // namespace sightline
