// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/physics/angle.h"
#include "planning/placement/placement_coverage.h"
#include "planning/placement/placement_draws.h"

namespace sightline {
namespace {

PlacementModel Model() {
  PlacementModel model;
  model.errors = {2e-3, kRadPerDeg, 3e-3, 2 * kRadPerDeg};
  return model;
}

// Two scans from one place of the sensors, and two from another with the part untouched in between.
std::vector<Measurement> Scans() {
  std::vector<Measurement> scans(4);
  scans[1].part_gamma_rad = 1;
  scans[2].part_gamma_rad = 1;
  scans[2].camera_polar_rad = 0.5;
  scans[3] = scans[2];
  scans[3].offset_y_m = 0.01;
  return scans;
}

TEST(PlacementDraws, ErrorsHoldAsLongAsNothingIsTouched) {
  const std::vector<Measurement> scans = Scans();
  const std::vector<ScanDisplacement> d = PlacementDraws(Model(), scans).Draw(1, 0);
  ASSERT_EQ(d.size(), 4U);
  EXPECT_EQ(d[0].camera.translation_m, d[1].camera.translation_m);
  EXPECT_EQ(d[0].laser.rotation_rad, d[1].laser.rotation_rad);
  EXPECT_NE(d[1].camera.translation_m, d[2].camera.translation_m);
  EXPECT_EQ(d[2].laser.translation_m, d[3].laser.translation_m);
  EXPECT_NE(d[0].part.translation_m, d[1].part.translation_m);
  EXPECT_EQ(d[1].part.rotation_rad, d[2].part.rotation_rad);
  EXPECT_NE(d[2].part.rotation_rad, d[3].part.rotation_rad);
}

TEST(PlacementDraws, GroupsHaveNoErrorInCommon) {
  const std::vector<Measurement> scans = Scans();
  // The part links the two places of the sensors.
  EXPECT_EQ(PlacementDraws(Model(), scans).group_ends(), std::vector<size_t>{4});
  std::vector<Measurement> apart = scans;
  apart[2].part_gamma_rad = apart[3].part_gamma_rad = 2;
  EXPECT_EQ(PlacementDraws(Model(), apart).group_ends(), (std::vector<size_t>{2, 4}));
  PlacementModel robot = Model();
  robot.execution.robot_holds_head = robot.execution.robot_holds_part = true;
  EXPECT_EQ(PlacementDraws(robot, scans).group_ends(), (std::vector<size_t>{1, 2, 3, 4}));
}

TEST(PlacementDraws, HaveTheStatedDeviations) {
  const std::vector<Measurement> scans(1);
  const PlacementModel model = Model();
  const PlacementDraws draws(model, scans);
  constexpr int kDraws = 4000;
  double part_m2 = 0, part_rad2 = 0, laser_m2 = 0, camera_rad2 = 0;
  for (uint32_t e = 0; e < kDraws; ++e) {
    const ScanDisplacement d = draws.Draw(1, e)[0];
    part_m2 += d.part.translation_m.squaredNorm() / 3;
    part_rad2 += d.part.rotation_rad.squaredNorm() / 3;
    laser_m2 += d.laser.translation_m.squaredNorm() / 3;
    camera_rad2 += d.camera.rotation_rad.squaredNorm() / 3;
  }
  EXPECT_NEAR(std::sqrt(part_m2 / kDraws) / model.errors.part_position_m, 1, 0.03);
  EXPECT_NEAR(std::sqrt(part_rad2 / kDraws) / model.errors.part_angle_rad, 1, 0.03);
  EXPECT_NEAR(std::sqrt(laser_m2 / kDraws) / model.errors.sensor_position_m, 1, 0.03);
  EXPECT_NEAR(std::sqrt(camera_rad2 / kDraws) / model.errors.sensor_angle_rad, 1, 0.03);
}

TEST(PlacementDraws, OneHousingKeepsCameraAndLaserTogether) {
  PlacementModel model = Model();
  model.rigid_head = true;
  const std::vector<Measurement> scans(1);
  const ScanGeometry planned = MakeScanGeometry(model.rig, scans[0]);
  const ScanGeometry placed = Displaced(planned, PlacementDraws(model, scans).Draw(1, 0)[0]);
  const auto laser_from_camera = [](const ScanGeometry& g) {
    return Eigen::Matrix4d(g.camera.Matrix().inverse() * g.laser.Matrix());
  };
  EXPECT_GT((placed.laser.origin_m - planned.laser.origin_m).norm(), 1e-3);
  EXPECT_LT((laser_from_camera(placed) - laser_from_camera(planned)).norm(), 1e-12);
}

TEST(PlacementDraws, ATableKeepsThePartUpright) {
  PlacementModel model = Model();
  model.on_table = true;
  const std::vector<Measurement> scans(1);
  const Displacement part = PlacementDraws(model, scans).Draw(1, 0)[0].part;
  EXPECT_EQ(part.rotation_rad.head<2>().norm(), 0);
  EXPECT_NE(part.rotation_rad.z(), 0);
}

// Bits [begin, end) of 100.
TargetBits Range(size_t begin, size_t end) {
  TargetBits bits(100);
  for (size_t t = begin; t < end; ++t) bits.Set(t);
  return bits;
}

TEST(CombineExecutions, OneGroupIsItsDraws) {
  const std::vector<std::vector<TargetBits>> covered = {{Range(0, 50), Range(40, 60)},
                                                        {Range(0, 30), Range(90, 100)}};
  EXPECT_EQ(CombineExecutions(covered, std::vector<size_t>{2}, 1000),
            (std::vector<int64_t>{60, 40}));
}

TEST(CombineExecutions, GroupsCombineIndependently) {
  // Each group covers 10 or 50 targets of its own: sums 20, 60, 60, 100, equally often.
  const std::vector<std::vector<TargetBits>> covered = {{Range(0, 10), Range(50, 60)},
                                                        {Range(0, 50), Range(50, 100)}};
  constexpr int kExecutions = 4000;
  int of[3] = {0, 0, 0};
  for (const int64_t count : CombineExecutions(covered, std::vector<size_t>{1, 2}, kExecutions)) {
    ASSERT_TRUE(count == 20 || count == 60 || count == 100) << count;
    ++of[(count - 20) / 40];
  }
  EXPECT_NEAR(of[0], 0.25 * kExecutions, 150);
  EXPECT_NEAR(of[1], 0.5 * kExecutions, 150);
  EXPECT_NEAR(of[2], 0.25 * kExecutions, 150);
}

TEST(PlacementCoverage, IsTheTwentiethOfExecutions) {
  // One of the 24 draws in 24 covers nothing, the others everything: more than 95 of 100 succeed.
  const std::vector<Measurement> scans(1);
  int failures = 0;
  const DisplacedEvaluation evaluate = [&](std::span<const Measurement> measurements,
                                           std::span<const ScanDisplacement>) {
    std::vector<ScanCoverage> coverages(measurements.size());
    for (size_t i = 0; i < coverages.size(); ++i) {
      coverages[i].covered = i < static_cast<size_t>(failures) ? TargetBits(100) : Range(0, 80);
    }
    return absl::StatusOr<std::vector<ScanCoverage>>(std::move(coverages));
  };
  failures = 1;
  EXPECT_EQ(PlacementCoverage(Model(), scans, 100, evaluate).value(), 0.8);
  failures = 3;
  EXPECT_EQ(PlacementCoverage(Model(), scans, 100, evaluate).value(), 0);
}

TEST(PlacementCoverage, DrawsAreAboutAsManyEvaluationsForEveryPlan) {
  EXPECT_EQ(PlacementDrawsFor(1), 24);
  EXPECT_EQ(PlacementDrawsFor(15), 24);
  EXPECT_EQ(PlacementDrawsFor(20), 18);
  EXPECT_EQ(PlacementDrawsFor(1000), 12);
}

TEST(PlacementCoverage, PassesErrorsOn) {
  const auto refuse = [](std::span<const Measurement>, std::span<const ScanDisplacement>) {
    return absl::StatusOr<std::vector<ScanCoverage>>(absl::UnavailableError("gone"));
  };
  EXPECT_EQ(PlacementCoverage(Model(), std::vector<Measurement>(1), 100, refuse).status().code(),
            absl::StatusCode::kUnavailable);
}

}  // namespace
}  // namespace sightline
