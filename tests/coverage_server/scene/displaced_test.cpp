// SPDX-License-Identifier: Apache-2.0
// Scans whose part, camera and laser are not where their measurement has them.
#include <gtest/gtest.h>

#include <memory>
#include <numbers>

#include "core/rig/scan_geometry.h"
#include "coverage_server/scene/coverage_scene.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

std::unique_ptr<CoverageScene> Scene() {
  SceneDefinition definition;
  definition.part = SteppedPart();
  definition.field_directions = 64;
  SceneBuildOptions options;
  options.threads = 1;
  auto scene = CoverageScene::Build(std::move(definition), options);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? *std::move(scene) : nullptr;
}

// Fraction of the targets that one of two scans covers, and not the other.
double Difference(const ExactCoverage& a, const ExactCoverage& b) {
  return static_cast<double>(a.covered.CountNotIn(b.covered) + b.covered.CountNotIn(a.covered)) /
         static_cast<double>(a.covered.size());
}

TEST(DisplacedScans, InTheirPlaceAreThePlannedOnes) {
  const auto scene = Scene();
  ASSERT_NE(scene, nullptr);
  Random random(5);
  for (int i = 0; i < 20; ++i) {
    const Measurement m = RandomMeasurement(random);
    const ExactCoverage planned = scene->EvaluateExact(m, nullptr, nullptr);
    if (planned.feasibility != Feasibility::kFeasible) continue;
    const ExactCoverage placed = scene->EvaluateDisplaced(m, {}, nullptr);
    EXPECT_EQ(placed.covered.ToBytes(), planned.covered.ToBytes());
    EXPECT_EQ(placed.first_frame, planned.first_frame);
    EXPECT_EQ(placed.last_frame, planned.last_frame);
    EXPECT_EQ(placed.measurement_points, planned.measurement_points);
  }
}

TEST(DisplacedScans, TurnAndShiftOfThePartAreThoseOfTheMeasurement) {
  const auto scene = Scene();
  ASSERT_NE(scene, nullptr);
  constexpr double kTurn_rad = 0.1, kShift_m = 0.004;
  Measurement m = OverheadMeasurement(0.5), other = m;
  other.part_gamma_rad += kTurn_rad;
  other.offset_y_m += kShift_m;
  other.offset_z_m -= kShift_m;
  ScanDisplacement displacement;
  displacement.part.rotation_rad = {0, 0, kTurn_rad};
  displacement.part.translation_m = {0, kShift_m, -kShift_m};
  const ExactCoverage want = scene->EvaluateExact(other, nullptr, nullptr);
  ASSERT_GT(want.covered.Count(), 0);
  EXPECT_LT(Difference(scene->EvaluateDisplaced(m, displacement, nullptr), want), 1e-3);
}

TEST(DisplacedScans, ShiftsAreRelative) {
  const auto scene = Scene();
  ASSERT_NE(scene, nullptr);
  const Measurement m = OverheadMeasurement(0.5);
  const ExactCoverage planned = scene->EvaluateExact(m, nullptr, nullptr);
  ScanDisplacement all;
  all.part.translation_m = all.camera.translation_m = all.laser.translation_m = {0.01, -0.02, 0.03};
  EXPECT_LT(Difference(scene->EvaluateDisplaced(m, all, nullptr), planned), 1e-3);
  // Along the stage a whole number of frames changes nothing but the numbers of the frames.
  ScanDisplacement along;
  along.part.translation_m.x() = 5 * scene->rig().scan_step_m;
  const ExactCoverage later = scene->EvaluateDisplaced(m, along, nullptr);
  EXPECT_LT(Difference(later, planned), 1e-3);
  EXPECT_NEAR(later.first_frame, planned.first_frame - 5, 1);
}

TEST(DisplacedScans, ACameraThatLooksAsideMeasuresNothing) {
  const auto scene = Scene();
  ASSERT_NE(scene, nullptr);
  ScanDisplacement aside;
  aside.camera.rotation_rad = {0, std::numbers::pi / 2, 0};
  aside.laser.rotation_rad = {0, std::numbers::pi / 2, 0};
  EXPECT_EQ(scene->EvaluateDisplaced(OverheadMeasurement(0.5), aside, nullptr).covered.Count(), 0);
}

TEST(DisplacedScans, TouchThePartWithoutItsClearance) {
  SceneDefinition definition;
  definition.part = SteppedPart();
  definition.field_directions = 64;
  definition.rig.clearance_m = 0.2;
  const auto scene = CoverageScene::Build(std::move(definition), {});
  ASSERT_TRUE(scene.ok()) << scene.status();
  Measurement near = OverheadMeasurement(0.5);
  near.camera_distance_m = 0.2;
  ASSERT_EQ((*scene)->EvaluateExact(near, nullptr, nullptr).feasibility, Feasibility::kCollision);
  EXPECT_EQ((*scene)->EvaluateDisplaced(near, {}, nullptr).feasibility, Feasibility::kFeasible);
  // The camera stands where the laser is and looks as it does.
  const ScanGeometry g = MakeScanGeometry((*scene)->rig(), near);
  const Eigen::AngleAxisd turn(
      Eigen::Matrix3d(g.laser.Matrix().topLeftCorner<3, 3>() *
                      g.camera.Matrix().topLeftCorner<3, 3>().transpose()));
  ScanDisplacement same_place;
  same_place.camera.rotation_rad = turn.angle() * turn.axis();
  same_place.camera.translation_m = g.laser.origin_m - g.camera.origin_m;
  const ExactCoverage touching = (*scene)->EvaluateDisplaced(near, same_place, nullptr);
  EXPECT_EQ(touching.feasibility, Feasibility::kCollision);
  EXPECT_EQ(touching.covered.Count(), 0);
}

}  // namespace
}  // namespace sightline
