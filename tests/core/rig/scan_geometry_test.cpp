// SPDX-License-Identifier: Apache-2.0
#include "core/rig/scan_geometry.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/physics/angle.h"

namespace sightline {
namespace {

double Uniform(std::mt19937_64& random, double min, double max) {
  return min + (max - min) * std::generate_canonical<double, 53>(random);
}

// Any measurement of Table 2.1.
Measurement RandomMeasurement(std::mt19937_64& random) {
  Measurement m;
  m.camera_distance_m = Uniform(random, 0.1, 0.8);
  m.triangulation_angle_rad =
      Uniform(random, 10 * kRadPerDeg, 80 * kRadPerDeg) * (random() % 2 == 0 ? 1 : -1);
  m.camera_azimuth_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.camera_polar_rad = Uniform(random, 0, 90 * kRadPerDeg);
  m.part_alpha_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.part_beta_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.part_gamma_rad = Uniform(random, 0, 360 * kRadPerDeg);
  m.offset_y_m = Uniform(random, -0.5, 0.5);
  m.offset_z_m = Uniform(random, -0.4, 0.4);
  return m;
}

Eigen::Vector3d RandomPoint(std::mt19937_64& random, double size) {
  return {Uniform(random, -size, size), Uniform(random, -size, size), Uniform(random, -size, size)};
}

class ScanGeometryTest : public ::testing::Test {
 protected:
  std::mt19937_64 random_{7};
  Rig rig_;
};

TEST_F(ScanGeometryTest, CameraAndLaserLookAtTheOriginFromTheirDistance) {
  rig_.laser.distance_m = 0.33;
  for (int i = 0; i < 100; ++i) {
    const Measurement m = RandomMeasurement(random_);
    const ScanGeometry g = MakeScanGeometry(rig_, m);
    EXPECT_NEAR((g.camera.origin_m + m.camera_distance_m * g.camera.z_axis).norm(), 0, 1e-12);
    EXPECT_NEAR((g.laser.origin_m + 0.33 * g.laser.z_axis).norm(), 0, 1e-12);
    for (const SensorPose& pose : {g.camera, g.laser}) {
      Eigen::Matrix3d axes;
      axes << pose.x_axis, pose.y_axis, pose.z_axis;
      EXPECT_NEAR((axes.transpose() * axes - Eigen::Matrix3d::Identity()).norm(), 0, 1e-12);
      EXPECT_NEAR(axes.determinant(), 1, 1e-12);
    }
  }
}

TEST_F(ScanGeometryTest, CameraStandsWhereThePolarCoordinatesSay) {
  for (int i = 0; i < 100; ++i) {
    const Measurement m = RandomMeasurement(random_);
    const ScanGeometry g = MakeScanGeometry(rig_, m);
    const double polar = std::acos(g.camera.origin_m.z() / m.camera_distance_m);
    EXPECT_NEAR(polar, m.camera_polar_rad, 1e-7);
    if (m.camera_polar_rad > 1e-3) {
      const double azimuth = std::atan2(g.camera.origin_m.y(), g.camera.origin_m.x());
      EXPECT_NEAR(std::remainder(azimuth - m.camera_azimuth_rad, 2 * std::numbers::pi), 0, 1e-9);
    }
  }
}

TEST_F(ScanGeometryTest, LaserStandsAtTheCameraDistanceByDefault) {
  const Measurement m = RandomMeasurement(random_);
  EXPECT_NEAR(MakeScanGeometry(rig_, m).laser.origin_m.norm(), m.camera_distance_m, 1e-12);
}

TEST_F(ScanGeometryTest, SheetContainsSourceOriginAndLineDirection) {
  for (int i = 0; i < 100; ++i) {
    const Measurement m = RandomMeasurement(random_);
    const ScanGeometry g = MakeScanGeometry(rig_, m);
    const Eigen::Vector3d e(-std::sin(m.camera_azimuth_rad), std::cos(m.camera_azimuth_rad), 0);
    EXPECT_NEAR(g.sheet_normal.norm(), 1, 1e-12);
    EXPECT_NEAR(g.sheet_normal.dot(g.laser.origin_m), 0, 1e-12);
    EXPECT_NEAR(g.sheet_normal.dot(e), 0, 1e-12);
    // The line lies along the image rows.
    EXPECT_NEAR((g.camera.x_axis - e).norm(), 0, 1e-12);
  }
}

TEST_F(ScanGeometryTest, TriangulationAngleIsTheAngleBetweenSensors) {
  for (int i = 0; i < 100; ++i) {
    const Measurement m = RandomMeasurement(random_);
    const ScanGeometry g = MakeScanGeometry(rig_, m);
    const double angle = std::acos(g.camera.z_axis.dot(g.laser.z_axis));
    EXPECT_NEAR(angle, std::abs(m.triangulation_angle_rad), 1e-9);
  }
}

TEST_F(ScanGeometryTest, SignOfTheTriangulationAngleSaysOnWhichSideTheLaserStands) {
  Measurement m;
  m.camera_azimuth_rad = 0;
  m.camera_polar_rad = 45 * kRadPerDeg;
  m.triangulation_angle_rad = 30 * kRadPerDeg;  // laser at polar angle 15: higher
  EXPECT_NEAR(MakeScanGeometry(rig_, m).laser.origin_m.z(),
              m.camera_distance_m * std::cos(15 * kRadPerDeg), 1e-12);
  m.triangulation_angle_rad = -30 * kRadPerDeg;  // at 75: lower
  EXPECT_NEAR(MakeScanGeometry(rig_, m).laser.origin_m.z(),
              m.camera_distance_m * std::cos(75 * kRadPerDeg), 1e-12);
}

TEST_F(ScanGeometryTest, LitStagePositionPutsThePointOnTheSheet) {
  int checked = 0;
  for (int i = 0; i < 200; ++i) {
    const ScanGeometry g = MakeScanGeometry(rig_, RandomMeasurement(random_));
    if (std::abs(g.sheet_normal.x()) < 0.05) continue;
    const Eigen::Vector3d centre = RandomPoint(random_, 0.3), point = RandomPoint(random_, 0.3);
    const double s = g.LitStagePosition(PartToWorld(g, centre, point, 0));
    EXPECT_NEAR(g.sheet_normal.dot(PartToWorld(g, centre, point, s)), 0, 1e-12);
    EXPECT_GT(std::abs(g.sheet_normal.dot(PartToWorld(g, centre, point, s + 0.01))), 1e-4);
    ++checked;
  }
  EXPECT_GT(checked, 100);
}

TEST_F(ScanGeometryTest, SheetAlongTheScanDirectionNeverPassesAPoint) {
  Measurement m;
  m.camera_azimuth_rad = 90 * kRadPerDeg;  // e = -x: the sheet contains x
  const ScanGeometry g = MakeScanGeometry(rig_, m);
  EXPECT_GT(std::abs(g.LitStagePosition({0.1, 0.2, 0.3})), 1e12);
}

TEST_F(ScanGeometryTest, PartCentreTravelsAlongTheStage) {
  const Measurement m = RandomMeasurement(random_);
  const ScanGeometry g = MakeScanGeometry(rig_, m);
  const Eigen::Vector3d centre(1, 2, 3);
  EXPECT_NEAR(
      (PartToWorld(g, centre, centre, 0.25) - Eigen::Vector3d(0.25, m.offset_y_m, m.offset_z_m))
          .norm(),
      0, 1e-12);
}

TEST_F(ScanGeometryTest, PartTurnsAboutXThenYThenZ) {
  Measurement m;
  m.part_alpha_rad = 90 * kRadPerDeg;  // z -> -y, y -> z
  m.part_beta_rad = 90 * kRadPerDeg;   // z -> x, x -> -z
  m.part_gamma_rad = 90 * kRadPerDeg;  // x -> y, y -> -x
  const ScanGeometry g = MakeScanGeometry(rig_, m);
  // y: alpha makes it z, beta makes it x, gamma makes it y.
  EXPECT_NEAR((g.part_rotation * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitY()).norm(), 0,
              1e-12);
  // z: alpha -y, beta -y, gamma x.
  EXPECT_NEAR((g.part_rotation * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 0,
              1e-12);
  // x: alpha x, beta -z, gamma -z.
  EXPECT_NEAR((g.part_rotation * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitZ()).norm(), 0,
              1e-12);
}

TEST_F(ScanGeometryTest, WorldToPartUndoesPartToWorld) {
  for (int i = 0; i < 100; ++i) {
    const ScanGeometry g = MakeScanGeometry(rig_, RandomMeasurement(random_));
    const Eigen::Vector3d centre = RandomPoint(random_, 0.3);
    const double s = Uniform(random_, -0.5, 0.5);
    const SensorPose part = WorldToPart(g, centre, g.camera, s);
    const Eigen::Vector3d in_camera = RandomPoint(random_, 0.5);
    const Eigen::Vector3d x_part = (part.Matrix() * in_camera.homogeneous()).head<3>();
    const Eigen::Vector3d x_world = (g.camera.Matrix() * in_camera.homogeneous()).head<3>();
    EXPECT_NEAR((PartToWorld(g, centre, x_part, s) - x_world).norm(), 0, 1e-12);
  }
}

// A point lit by the sheet, projected to a pixel and back along the pixel's ray to the sheet, is
// the same point: what every measurement point rests on.
TEST_F(ScanGeometryTest, TriangulationRoundTrip) {
  rig_.camera.columns_px = 640;
  rig_.camera.rows_px = 480;
  const double f = rig_.camera.FocalLengthPx();
  int checked = 0;
  for (int i = 0; i < 500; ++i) {
    const ScanGeometry g = MakeScanGeometry(rig_, RandomMeasurement(random_));
    if (std::abs(g.sheet_normal.x()) < 0.05) continue;
    const Eigen::Vector3d centre = RandomPoint(random_, 0.2), point = RandomPoint(random_, 0.2);
    const double s = g.LitStagePosition(PartToWorld(g, centre, point, 0));
    const SensorPose camera = WorldToPart(g, centre, g.camera, s);
    const Eigen::Vector3d d = point - camera.origin_m;
    const double z = d.dot(camera.z_axis);
    if (z < 0.02) continue;
    const double column = 0.5 * rig_.camera.columns_px + f * d.dot(camera.x_axis) / z;
    const double row = 0.5 * rig_.camera.rows_px + f * d.dot(camera.y_axis) / z;

    const Eigen::Vector3d ray = camera.x_axis * (column - 0.5 * rig_.camera.columns_px) +
                                camera.y_axis * (row - 0.5 * rig_.camera.rows_px) +
                                f * camera.z_axis;
    const SensorPose laser = WorldToPart(g, centre, g.laser, s);
    const Eigen::Vector3d normal = g.part_rotation.transpose() * g.sheet_normal;
    const double along = normal.dot(laser.origin_m - camera.origin_m) / normal.dot(ray);
    EXPECT_NEAR((camera.origin_m + along * ray - point).norm(), 0, 1e-9);
    ++checked;
  }
  EXPECT_GT(checked, 150);
}

// Rows count downwards: what is higher on the camera's side appears further up.
TEST_F(ScanGeometryTest, ImageIsUpright) {
  Measurement m;
  m.camera_polar_rad = 90 * kRadPerDeg;  // horizontal view along -x
  const ScanGeometry g = MakeScanGeometry(rig_, m);
  EXPECT_LT(Eigen::Vector3d::UnitZ().dot(g.camera.y_axis), -0.999);
}

TEST(Camera, FocalLengthFollowsTheFieldOfView) {
  Camera camera;
  camera.rows_px = 400;
  camera.vertical_fov_rad = 90 * kRadPerDeg;
  EXPECT_NEAR(camera.FocalLengthPx(), 200, 1e-9);
  // The top row's edge is seen at half the field of view.
  camera.vertical_fov_rad = 30 * kRadPerDeg;
  EXPECT_NEAR(std::atan(200 / camera.FocalLengthPx()), 15 * kRadPerDeg, 1e-12);
}

TEST(Measurement, ArrayRoundTripKeepsTheOrder) {
  const std::array<double, kMeasurementParameters> p = {1, 2, 3, 4, 5, 6, 7, 8, 9};
  const Measurement m = FromArray(p);
  EXPECT_EQ(m.camera_distance_m, 1);
  EXPECT_EQ(m.part_gamma_rad, 7);
  EXPECT_EQ(m.offset_z_m, 9);
  EXPECT_EQ(ToArray(m), p);
}

TEST(AdmissibleDepth, NoLimitAdmitsEverything) {
  const PointLimits depth = AdmissibleDepth(Rig(), 0.4, std::nullopt, std::nullopt);
  EXPECT_EQ(depth.min_m, 0);
  EXPECT_TRUE(std::isinf(depth.max_m));
}

TEST(AdmissibleDepth, FootprintOfOnePixelGrowsWithDepth) {
  Rig rig;
  const PointLimits depth = AdmissibleDepth(rig, 0.4, 2e-4, std::nullopt);
  EXPECT_NEAR(depth.max_m / rig.camera.FocalLengthPx(), 2e-4, 1e-15);
}

// Thin lens by ray tracing through the rim of the pupil: the blur of a point at depth z on a sensor
// focused at z0, independent of the closed form.
double CircleOfConfusionPx(const Rig& rig, double focus_m, double z_m) {
  const double f = rig.lens->focal_length_m;
  const double sensor = focus_m * f / (focus_m - f);  // image distance of the focused plane
  const double image = z_m * f / (z_m - f);           // image distance of the point
  const double pupil = f / rig.lens->f_number;
  // Rays from the rim of the pupil meet at `image`; the sensor cuts their cone at `sensor`.
  return pupil * std::abs(sensor - image) / image / *rig.camera.pixel_pitch_m;
}

TEST(AdmissibleDepth, CircleOfConfusionIsMetExactlyAtBothEnds) {
  Rig rig;
  rig.lens.emplace();
  rig.lens->focal_length_m = 0.016;
  rig.lens->f_number = 2;
  rig.camera.pixel_pitch_m = 5e-6;
  for (double focus : {0.1, 0.3, 0.8}) {
    for (double limit : {0.5, 2.0, 5.0}) {
      const PointLimits depth = AdmissibleDepth(rig, focus, std::nullopt, limit);
      ASSERT_LT(depth.min_m, focus);
      ASSERT_GT(depth.max_m, focus);
      EXPECT_NEAR(CircleOfConfusionPx(rig, focus, depth.min_m), limit, 1e-6);
      if (std::isfinite(depth.max_m)) {
        EXPECT_NEAR(CircleOfConfusionPx(rig, focus, depth.max_m), limit, 1e-6);
      }
    }
  }
}

TEST(AdmissibleDepth, AStatedFocusDistanceCounts) {
  Rig rig;
  rig.lens.emplace();
  rig.lens->focal_length_m = 0.016;
  rig.lens->f_number = 2;
  rig.camera.pixel_pitch_m = 5e-6;
  const PointLimits at_focus = AdmissibleDepth(rig, 0.3, std::nullopt, 2.0);
  rig.lens->focus_distance_m = 0.3;
  const PointLimits stated = AdmissibleDepth(rig, 0.5, std::nullopt, 2.0);
  EXPECT_EQ(stated.min_m, at_focus.min_m);
  EXPECT_EQ(stated.max_m, at_focus.max_m);
}

TEST(AdmissibleDepth, BeyondTheHyperfocalDistanceEverythingFarIsSharp) {
  Rig rig;
  rig.lens.emplace();
  rig.lens->focal_length_m = 0.004;
  rig.lens->f_number = 16;
  rig.camera.pixel_pitch_m = 5e-6;
  const PointLimits depth = AdmissibleDepth(rig, 0.8, std::nullopt, 3.0);
  EXPECT_TRUE(std::isinf(depth.max_m));
  EXPECT_LE(CircleOfConfusionPx(rig, 0.8, 1e6), 3.0);
}

}  // namespace
}  // namespace sightline
