// SPDX-License-Identifier: Apache-2.0
#include "planner_client/scan_quality/scan_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr double kRad = std::numbers::pi / 180;

// A flat plate z = 0, level, through the origin; camera straight above, laser 30 degrees beside.
constexpr double kDistance_m = 0.4, kAngle_rad = 30 * kRad;

Rig PlateRig() {
  Rig rig;
  rig.camera.columns_px = rig.camera.rows_px = 1000;
  rig.camera.vertical_fov_rad = 2 * std::atan(0.25);  // f = 2000 px
  rig.scan_step_m = 1e-3;
  return rig;
}

Measurement FromAbove() {
  Measurement measurement;
  measurement.camera_distance_m = kDistance_m;
  measurement.triangulation_angle_rad = kAngle_rad;
  return measurement;
}

// The point at which camera and laser axis meet the plate: pixel d/f, angle tau, depth d/f /
// sin(tau).
TEST(QualityOfPoint, AtTheOriginIsThatOfTheRig) {
  const Rig rig = PlateRig();
  const PointQuality quality = QualityOfPoint(rig.camera, MakeScanGeometry(rig, FromAbove()),
                                              Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ());
  EXPECT_NEAR(quality.pixel_footprint_m, kDistance_m / 2000, 1e-15);
  EXPECT_NEAR(quality.triangulation_angle_rad, kAngle_rad, 1e-12);
  EXPECT_NEAR(quality.depth_per_pixel_m, kDistance_m / 2000 / 0.5, 1e-15);
  EXPECT_NEAR(quality.camera_incidence_rad, 0, 1e-12);
  EXPECT_NEAR(quality.laser_incidence_rad, kAngle_rad, 1e-12);
}

// Along the line of the plate, y away from the middle: the sheet is 30 degrees off the vertical
// about the line, so that a ray (0, y, -d) has n . ray = d sin(tau) / sqrt(d^2 + y^2) with it; both
// incidences follow from the lengths of the rays.
TEST(QualityOfPoint, AlongTheLineFollowsTheClosedForm) {
  const Rig rig = PlateRig();
  const ScanGeometry geometry = MakeScanGeometry(rig, FromAbove());
  for (const double y_m : {-0.08, 0.03, 0.1}) {
    const PointQuality quality =
        QualityOfPoint(rig.camera, geometry, {0, y_m, 0}, Eigen::Vector3d::UnitZ());
    const double ray_m = std::hypot(kDistance_m, y_m);
    const double sine = kDistance_m * std::sin(kAngle_rad) / ray_m;
    EXPECT_NEAR(quality.pixel_footprint_m, kDistance_m / 2000, 1e-15);
    EXPECT_NEAR(quality.triangulation_angle_rad, std::asin(sine), 1e-12);
    EXPECT_NEAR(quality.depth_per_pixel_m, kDistance_m / 2000 / sine, 1e-15);
    EXPECT_NEAR(quality.camera_incidence_rad, std::acos(kDistance_m / ray_m), 1e-12);
    EXPECT_NEAR(quality.laser_incidence_rad, std::acos(kDistance_m * std::cos(kAngle_rad) / ray_m),
                1e-12);
  }
}

// A surface from below faces away from both.
TEST(QualityOfPoint, SurfaceThatFacesAwayIsBeyondARightAngle) {
  const Rig rig = PlateRig();
  const PointQuality quality = QualityOfPoint(rig.camera, MakeScanGeometry(rig, FromAbove()),
                                              Eigen::Vector3d::Zero(), -Eigen::Vector3d::UnitZ());
  EXPECT_NEAR(quality.camera_incidence_rad, std::numbers::pi, 1e-12);
  EXPECT_NEAR(quality.laser_incidence_rad, std::numbers::pi - kAngle_rad, 1e-12);
}

// Points of a plate that the stage carries under a line that stands still: every frame sees the
// same, wherever it is on the part.
TEST(QualityOfScan, IsThatOfTheLineWhateverTheFrame) {
  const Rig rig = PlateRig();
  const Eigen::Vector3d centre_m(0.05, 0.02, 0.01);
  std::vector<MeasuredPoint> points;
  for (int frame = -30; frame <= 30; ++frame) {
    // X_world = X_part - centre + stage, lit at x = 0.
    const Eigen::Vector3d place_m = centre_m - frame * 1e-3 * Eigen::Vector3d::UnitX();
    points.push_back({place_m.cast<float>(), Eigen::Vector3f::UnitZ(), frame});
  }
  const auto quality = QualityOfScan(rig, FromAbove(), centre_m, points);
  ASSERT_TRUE(quality.has_value());
  for (const double value : {quality->depth_per_pixel_m.low, quality->depth_per_pixel_m.median,
                             quality->depth_per_pixel_m.high}) {
    EXPECT_NEAR(value, 4e-4, 1e-9);  // positions are single precision
  }
  EXPECT_NEAR(quality->triangulation_angle_rad.median, kAngle_rad, 1e-6);
  EXPECT_FALSE(QualityOfScan(rig, FromAbove(), centre_m, {}).has_value());
}

TEST(SpreadOf, HasNinetyFiveOfAHundredBetweenItsLimits) {
  std::vector<double> values;
  for (int i = 200; i >= 0; --i) values.push_back(i);
  const Spread spread = SpreadOf(values);
  EXPECT_DOUBLE_EQ(spread.low, 5);
  EXPECT_DOUBLE_EQ(spread.median, 100);
  EXPECT_DOUBLE_EQ(spread.high, 195);
  EXPECT_DOUBLE_EQ(SpreadOf({3}).high, 3);
  EXPECT_DOUBLE_EQ(SpreadOf({1, 2}).median, 1.5);
}

// The steeper of two scans is the finer one; what none covers has no depth.
TEST(BestDepthPerPixel, TakesTheFinestScanOfEachTarget) {
  Measurement steep = FromAbove(), flat = FromAbove();
  flat.triangulation_angle_rad = 15 * kRad;
  TargetSet targets;
  for (const float y_m : {0.0f, 0.01f, 0.02f}) {
    targets.positions_m.emplace_back(0.03f, y_m, 0.0f);
    targets.normals.push_back(Eigen::Vector3f::UnitZ());
  }
  std::vector<TargetBits> covered(2, TargetBits(3));
  covered[0].Set(0);
  covered[1].Set(0);
  covered[1].Set(1);
  const std::vector<Measurement> scans = {steep, flat};
  const std::vector<float> depth_m =
      BestDepthPerPixel(PlateRig(), scans, covered, Eigen::Vector3d::Zero(), targets);
  EXPECT_NEAR(depth_m[0], 2e-4 / std::sin(30 * kRad), 1e-9);
  const double sine = kDistance_m * std::sin(15 * kRad) / std::hypot(kDistance_m, 0.01);
  EXPECT_NEAR(depth_m[1], 2e-4 / sine, 1e-9);
  EXPECT_EQ(depth_m[2], 0);
}

TEST(Overlaps, CountsWhatOthersCoverAsWell) {
  std::vector<TargetBits> covered(3, TargetBits(100));
  for (size_t i = 0; i < 40; ++i) covered[0].Set(i);
  for (size_t i = 30; i < 50; ++i) covered[1].Set(i);
  const std::vector<double> overlaps = Overlaps(covered);
  EXPECT_DOUBLE_EQ(overlaps[0], 0.25);
  EXPECT_DOUBLE_EQ(overlaps[1], 0.5);
  EXPECT_DOUBLE_EQ(overlaps[2], 0);  // covers nothing
  EXPECT_TRUE(Overlaps({}).empty());
}

}  // namespace
}  // namespace sightline
