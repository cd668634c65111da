// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/plan_time.h"

#include <gtest/gtest.h>

#include <numbers>
#include <vector>

namespace sightline {
namespace {

CostModel Costs() {
  CostModel costs;
  costs.stage_speed_m_per_s = 0.2;
  costs.frame_rate_hz = 100;
  costs.reposition_time_s = 3;
  costs.reposition_speed_rad_per_s = 0.5;
  costs.reposition_speed_m_per_s = 0.1;
  return costs;
}

std::vector<Measurement> ThreeScans() {
  std::vector<Measurement> scans(3);
  scans[1].part_gamma_rad = 2;
  scans[2].part_gamma_rad = 1;
  return scans;
}

TEST(PlanTimeTest, IsTheSumCalculatedByHand) {
  // Steps of 1 mm at 100 Hz: 0.1 m/s, the camera limits. 0.4 m, 0.1 m and 0.2 m of travel take 4, 1
  // and 2 s, of which the stage alone would need half. In the order 0, 2, 1 two moves of 1 rad take
  // 3 + 2 s each.
  const std::vector<FrameRange> frames = {{-100, 300}, {0, 100}, {50, 250}};
  const PlanTime time = TimeOfPlan(ExecutionModel{Costs()}, 0.001, ThreeScans(), frames, 0);
  EXPECT_NEAR(time.scan_s, 7, 1e-12);
  EXPECT_NEAR(time.frame_rate_s, 3.5, 1e-12);
  EXPECT_NEAR(time.reposition_s, 10, 1e-12);
  EXPECT_NEAR(time.Total_s(), 17, 1e-12);
}

TEST(PlanTimeTest, LockedScansStayInTheirOrder) {
  const std::vector<FrameRange> frames(3, {0, 100});
  // 0, 1, then 2: moves of 2 and 1 rad.
  const PlanTime time = TimeOfPlan(ExecutionModel{Costs()}, 0.001, ThreeScans(), frames, 2);
  EXPECT_NEAR(time.reposition_s, 2 * 3 + 4 + 2, 1e-12);
}

TEST(PlanTimeTest, LongerStepsAtTheSameFrameRateAreFaster) {
  const std::vector<Measurement> scans(1);
  const std::vector<FrameRange> fine = {{0, 400}}, coarse = {{0, 200}};  // 0.4 m both
  const PlanTime slow = TimeOfPlan(ExecutionModel{Costs()}, 0.001, scans, fine, 0);
  const PlanTime fast = TimeOfPlan(ExecutionModel{Costs()}, 0.002, scans, coarse, 0);
  EXPECT_NEAR(slow.scan_s, 4, 1e-12);
  EXPECT_NEAR(fast.scan_s, 2, 1e-12);
  EXPECT_NEAR(fast.frame_rate_s, 0, 1e-12);  // now as fast as the stage
}

TEST(PlanTimeTest, FrameRateAloneIsAllOfTheScanTime) {
  CostModel costs;
  costs.frame_rate_hz = 100;
  const PlanTime time = TimeOfPlan(ExecutionModel{costs}, 0.001, std::vector<Measurement>(1),
                                   std::vector<FrameRange>{{0, 400}}, 0);
  EXPECT_NEAR(time.scan_s, 4, 1e-12);
  EXPECT_EQ(time.frame_rate_s, time.scan_s);
}

TEST(PlanTimeTest, NoScansNoFramesAndNoCostsTakeNoTime) {
  EXPECT_EQ(TimeOfPlan(ExecutionModel{Costs()}, 0.001, {}, {}, 0).Total_s(), 0);
  const std::vector<FrameRange> none(1), some = {{0, 100}, {0, 100}, {0, 100}};
  EXPECT_EQ(
      TimeOfPlan(ExecutionModel{Costs()}, 0.001, std::vector<Measurement>(1), none, 0).Total_s(),
      0);
  EXPECT_EQ(TimeOfPlan(ExecutionModel{CostModel{}}, 0.001, ThreeScans(), some, 0).Total_s(), 0);
}

}  // namespace
}  // namespace sightline
