// SPDX-License-Identifier: Apache-2.0
// Scans whose result can be written down.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/physics/angle.h"
#include "coverage_server/scan/exact_evaluator.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

constexpr double kRoundingM = 2e-7;  // of float positions within half a metre

std::vector<MeasurementPoint> Measure(const TriangleMesh& part, const Rig& rig,
                                      const Measurement& m, const PointLimits& depth = {}) {
  return MeasureScan(part, rig, part.BoundingBox().center(), PartOccluder(part), m, depth, nullptr);
}

// A plate whose centre is the part's centre: lies in z = 0 of the world for a measurement without
// rotation and offset.
TEST(ClosedForm, CoveredWidthIsTheFieldOfView) {
  const TriangleMesh plate = PlateMesh(0.05, 0.8, 3, 7);
  Rig rig;
  for (const double height : {-0.1, 0.0, 0.1}) {
    Measurement m = OverheadMeasurement(20 * kRadPerDeg);
    m.offset_z_m = height;
    const auto points = Measure(plate, rig, m);
    ASSERT_FALSE(points.empty());
    double low = 1, high = 0;
    for (const auto& p : points) {
      low = std::min<double>(low, p.position_m.y());
      high = std::max<double>(high, p.position_m.y());
    }
    const double depth = 0.4 - height;
    const double per_column = depth / rig.camera.FocalLengthPx();
    // The centres of the outermost columns.
    EXPECT_NEAR(high - 0.4, (256 - 0.5) * per_column, kRoundingM);
    EXPECT_NEAR(low - 0.4, -(256 - 0.5) * per_column, kRoundingM);
    EXPECT_NEAR(512 * per_column, 2 * depth * std::tan(22.5 * kRadPerDeg), 1e-12);
    // One point in every column of every frame.
    std::map<int, int> per_frame;
    for (const auto& p : points) ++per_frame[p.frame];
    for (const auto& [frame, count] : per_frame) EXPECT_EQ(count, 512) << frame;
  }
}

TEST(ClosedForm, FanLimitsTheWidth) {
  const TriangleMesh plate = PlateMesh(0.05, 0.8, 3, 7);
  Rig rig;
  rig.laser.fan_angle_rad = 20 * kRadPerDeg;
  rig.laser.distance_m = 0.3;
  const Measurement m = OverheadMeasurement(20 * kRadPerDeg);
  const auto points = Measure(plate, rig, m);
  ASSERT_FALSE(points.empty());
  double widest = 0;
  for (const auto& p : points) widest = std::max<double>(widest, std::abs(p.position_m.y() - 0.4));
  const double limit = 0.3 * std::tan(10 * kRadPerDeg),
               per_column = 0.4 / rig.camera.FocalLengthPx();
  EXPECT_LE(widest, limit + kRoundingM);
  EXPECT_GE(widest, limit - per_column);
}

// A point of a plate tilted by beta about y lies at (x cos b, y, -x sin b); the sheet's normal is
// (cos tau, 0, sin tau), so s = -x cos(tau + b) / cos tau: the travel is L |cos(tau + b) / cos tau|
// and equals L for a level plate.
TEST(ClosedForm, TravelAndFrameSpacingOfATiltedPlate) {
  const double length = 0.1003;
  const TriangleMesh plate = PlateMesh(length, 0.02, 5, 2);
  Rig rig;
  rig.scan_step_m = 0.0005;
  for (const double tau : {-35.0, 15.0, 40.0}) {
    for (const double beta : {-25.0, 0.0, 20.0}) {
      Measurement m = OverheadMeasurement(tau * kRadPerDeg);
      m.part_beta_rad = (beta < 0 ? beta + 360 : beta) * kRadPerDeg;
      const auto points = Measure(plate, rig, m);
      ASSERT_FALSE(points.empty());
      const double travel =
          length * std::abs(std::cos((tau + beta) * kRadPerDeg) / std::cos(tau * kRadPerDeg));
      const int last = static_cast<int>(std::floor(0.5 * travel / rig.scan_step_m));
      EXPECT_EQ(points.back().frame, last) << tau << " " << beta;
      EXPECT_EQ(points.front().frame, -last) << tau << " " << beta;
      // Lines of neighbouring frames are step |n_x| / |n_t| apart on the surface, with n_t the part
      // of the sheet's normal along the plate: here |n_t| = |cos(tau + beta)|.
      const double spacing = rig.scan_step_m * std::cos(tau * kRadPerDeg) /
                             std::abs(std::cos((tau + beta) * kRadPerDeg));
      std::map<int, double> line;
      for (const auto& p : points) {
        if (!line.contains(p.frame)) line[p.frame] = p.position_m.x();
        EXPECT_NEAR(p.position_m.x(), line[p.frame], kRoundingM);  // across the scan direction
      }
      for (const auto& [frame, x] : line) {
        if (!line.contains(frame + 1)) continue;
        EXPECT_NEAR(std::abs(line[frame + 1] - x), spacing, kRoundingM);
      }
    }
  }
}

TEST(ClosedForm, RangeEndsOnACircle) {
  const TriangleMesh plate = PlateMesh(0.05, 0.8, 3, 7);
  Rig rig;
  rig.max_range_m = 0.42;
  const auto points = Measure(plate, rig, OverheadMeasurement(20 * kRadPerDeg));
  ASSERT_FALSE(points.empty());
  double widest = 0;
  for (const auto& p : points) widest = std::max<double>(widest, std::abs(p.position_m.y() - 0.4));
  const double limit = std::sqrt(0.42 * 0.42 - 0.4 * 0.4);  // the line runs below the camera
  EXPECT_LE(widest, limit + kRoundingM);
  EXPECT_GE(widest, limit - 0.4 / rig.camera.FocalLengthPx());
}

// A ramp through all depths: what is measured is the stretch the limits allow.
TEST(ClosedForm, LimitsOnFootprintAndDefocus) {
  const TriangleMesh plate = PlateMesh(0.3, 0.02, 60, 2);
  Rig rig;
  rig.lens.emplace();
  rig.lens->focal_length_m = 0.016;
  rig.lens->f_number = 2.8;
  rig.camera.pixel_pitch_m = 5e-6;
  Measurement m = OverheadMeasurement(20 * kRadPerDeg);
  m.part_beta_rad = 30 * kRadPerDeg;
  const double f = rig.camera.FocalLengthPx();
  const auto depths = [&](const PointLimits& limits) {
    const ScanGeometry g = MakeScanGeometry(rig, m);
    std::pair<double, double> range(std::numeric_limits<double>::infinity(), 0);
    for (const auto& p : Measure(plate, rig, m, limits)) {
      const double z = 0.4 - PartToWorld(g, plate.BoundingBox().center(),
                                         p.position_m.cast<double>(), p.frame * rig.scan_step_m)
                                 .z();
      range.first = std::min(range.first, z);
      range.second = std::max(range.second, z);
    }
    return range;
  };
  const auto all = depths({});
  EXPECT_LT(all.first, 0.35);
  EXPECT_GT(all.second, 0.45);
  constexpr double kFrameM = 0.002;  // depth from one frame to the next, at most

  const double footprint = 0.41 / f;  // metres a pixel
  const auto fine = depths(AdmissibleDepth(rig, m.camera_distance_m, footprint, std::nullopt));
  EXPECT_LE(fine.second, 0.41 + kRoundingM);
  EXPECT_GE(fine.second, 0.41 - kFrameM);
  EXPECT_NEAR(fine.first, all.first, 1e-9);

  // Blur circle of a point at z, focused at 0.4 m, from the thin lens equation.
  const auto blur_px = [&](double z) {
    const double focal = 0.016, aperture = focal / 2.8;
    const double sensor = 1 / (1 / focal - 1 / 0.4), image = 1 / (1 / focal - 1 / z);
    return aperture * std::abs(sensor - image) / image / 5e-6;
  };
  const auto sharp = depths(AdmissibleDepth(rig, m.camera_distance_m, std::nullopt, 2.0));
  EXPECT_LE(blur_px(sharp.first), 2 + 1e-3);
  EXPECT_LE(blur_px(sharp.second), 2 + 1e-3);
  EXPECT_GT(blur_px(sharp.first - kFrameM), 2);
  EXPECT_GT(blur_px(sharp.second + kFrameM), 2);
}

// Exactly the points that keep the limit on incidence are left.
TEST(ClosedForm, IncidenceLimitsTheSurface) {
  const TriangleMesh ball = SphereMesh(0.05, 4);
  const Rig rig;
  const Measurement m = OverheadMeasurement(25 * kRadPerDeg);
  PointLimits limits;
  limits.min_cos_incidence = std::cos(50 * kRadPerDeg);
  const ScanGeometry geometry = MakeScanGeometry(rig, m);
  const Eigen::Vector3d centre = ball.BoundingBox().center();
  const auto keeps = [&](const MeasurementPoint& p) {
    const double stage_m = p.frame * rig.scan_step_m;
    const Eigen::Vector3d x = PartToWorld(geometry, centre, p.position_m.cast<double>(), stage_m);
    const Eigen::Vector3d n = geometry.part_rotation * p.normal.cast<double>();
    return std::min(n.dot((geometry.camera.origin_m - x).normalized()),
                    n.dot((geometry.laser.origin_m - x).normalized())) -
           limits.min_cos_incidence;
  };
  int within = 0, beyond = 0;
  for (const MeasurementPoint& p : Measure(ball, rig, m)) {
    within += keeps(p) > 1e-5;
    beyond += keeps(p) < -1e-5;
  }
  EXPECT_GT(beyond, 100);
  int kept = 0;
  for (const MeasurementPoint& p : Measure(ball, rig, m, limits)) {
    ASSERT_GT(keeps(p), -1e-5);
    kept += keeps(p) > 1e-5;
  }
  EXPECT_EQ(kept, within);
}

TEST(ClosedForm, SheetAlongTheScanSweepsNothing) {
  // Camera and laser turned by 90 degrees: the sheet holds the scan direction.
  Measurement m = OverheadMeasurement(30 * kRadPerDeg);
  m.camera_azimuth_rad = 90 * kRadPerDeg;
  SceneDefinition definition;
  definition.part = SteppedPart();
  definition.field_directions = 64;
  EXPECT_TRUE(Measure(definition.part, definition.rig, m).empty());
  const auto scene = BuildScene(std::move(definition), 1);
  ASSERT_NE(scene, nullptr);
  const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
  EXPECT_EQ(exact.covered.Count(), 0);
  EXPECT_EQ(exact.measurement_points, 0);
  FastCoverage fast;
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(fast.covered.Count(), 0);
  // Turned by one degree less it would need metres of travel, or sees a thin strip: never a crash.
  m.camera_azimuth_rad = 89 * kRadPerDeg;
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(scene->EvaluateExact(m, nullptr, nullptr).covered.size(), fast.covered.size());
}

TEST(ClosedForm, StageTravelAndBounds) {
  SceneDefinition definition;
  definition.part = PlateMesh(0.1, 0.05, 10, 5);
  definition.field_directions = 64;
  definition.rig.stage_travel_m = 0.09;
  const auto scene = BuildScene(std::move(definition), 1);
  ASSERT_NE(scene, nullptr);
  Measurement m = OverheadMeasurement(30 * kRadPerDeg);
  FastCoverage fast;
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(fast.feasibility, Feasibility::kTravel);
  EXPECT_EQ(fast.covered.Count(), 0);
  const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
  EXPECT_EQ(exact.feasibility, Feasibility::kTravel);
  EXPECT_EQ(exact.covered.Count(), 0);
  // Across, the plate is 50 mm: that fits.
  m.part_gamma_rad = 90 * kRadPerDeg;
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(fast.feasibility, Feasibility::kFeasible);
  const ExactCoverage across = scene->EvaluateExact(m, nullptr, nullptr);
  EXPECT_EQ(across.feasibility, Feasibility::kFeasible);
  EXPECT_EQ(across.covered.Count(), static_cast<int64_t>(scene->targets().size()));
  EXPECT_EQ(fast.covered.Count(), static_cast<int64_t>(scene->targets().size()));

  m.camera_distance_m = 0.05;  // Table 2.1: at least 0.1 m
  EXPECT_EQ(scene->EvaluateExact(m, nullptr, nullptr).feasibility, Feasibility::kOutOfBounds);
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(fast.feasibility, Feasibility::kOutOfBounds);
  m.camera_distance_m = std::nan("");
  EXPECT_EQ(scene->EvaluateExact(m, nullptr, nullptr).feasibility, Feasibility::kOutOfBounds);
}

// From above, points on the upper face of a thin wall lie within the coverage radius of targets on
// the lower face, but measure nothing there.
TEST(ClosedForm, OtherSideOfAThinWall) {
  SceneDefinition definition;
  definition.part = BoxMesh({-0.04f, -0.03f, 0}, {0.04f, 0.03f, 0.0005f});
  definition.field_directions = 64;
  const auto scene = BuildScene(std::move(definition), 1);
  ASSERT_NE(scene, nullptr);
  const ExactCoverage exact =
      scene->EvaluateExact(OverheadMeasurement(25 * kRadPerDeg), nullptr, nullptr);
  ASSERT_EQ(exact.feasibility, Feasibility::kFeasible);
  int upper = 0, lower = 0;
  for (size_t t = 0; t < scene->targets().size(); ++t) {
    const float nz = scene->targets().normals[t].z();
    if (nz > 0.9f) {
      ++upper;
      EXPECT_TRUE(exact.covered.Test(t));
    } else if (nz < -0.9f) {
      ++lower;
      EXPECT_FALSE(exact.covered.Test(t));
      EXPECT_TRUE(exact.covered_without_normal_gate.Test(t));
    }
  }
  EXPECT_GT(upper, 100);
  EXPECT_GT(lower, 100);
}

// The bottom of a hole is reached by directions within atan(D / H) of each other at most.
TEST(ClosedForm, DeepHolesCannotBeMeasured) {
  for (const bool deep : {true, false}) {
    SceneDefinition definition;
    const double diameter = 0.01, depth = deep ? 0.1 : 0.01;  // 5.7 and 45 degrees
    definition.part = HolePart(0.04, 0.12, diameter, depth, 48);
    definition.sampling.spacing_m = 0.003;
    definition.sampling.coverage_radius_m = 0.002;
    definition.field_directions = 576;
    const auto scene = BuildScene(std::move(definition), 2);
    ASSERT_NE(scene, nullptr);
    int bottom = 0, bottom_measurable = 0, outside = 0, outside_measurable = 0;
    const double floor = scene->part().BoundingBox().max().z() - depth;
    for (size_t t = 0; t < scene->targets().size(); ++t) {
      const auto& p = scene->targets().positions_m[t];
      if (std::abs(p.z() - floor) < 1e-5 && scene->targets().normals[t].z() > 0.9f) {
        ++bottom;
        bottom_measurable += scene->measurable().Test(t);
      } else if (p.head<2>().norm() > 0.0195f) {
        ++outside;
        outside_measurable += scene->measurable().Test(t);
      }
    }
    EXPECT_GT(bottom, 4);
    EXPECT_EQ(bottom_measurable, deep ? 0 : bottom);
    EXPECT_GT(outside, 500);
    EXPECT_EQ(outside_measurable, outside);
  }
}

// A table in the world and a fixture on the stage cast shadows.
TEST(ClosedForm, ObstaclesHideInTheirFrames) {
  const TriangleMesh plate = PlateMesh(0.1, 0.1, 8, 8);
  const Measurement m = OverheadMeasurement(30 * kRadPerDeg);
  Rig rig;
  const auto count = [&](ObstacleFrame frame) {
    std::vector<Occluder> occluders = PartOccluder(plate);
    // A roof 0.2 m above the left half (y < 0) of the plate; in part coordinates its centre is at
    // (0.05, 0.05, 0).
    TriangleMesh roof = BoxMesh({-0.4f, -0.4f, 0.2f}, {0.4f, 0, 0.21f});
    if (frame == ObstacleFrame::kPart) {
      for (auto& p : roof.positions_m) p += Eigen::Vector3f(0.05f, 0.05f, 0);
    }
    occluders.push_back({frame, TriangleBvh(roof)});
    int left = 0, right = 0;
    for (const auto& p :
         MeasureScan(plate, rig, plate.BoundingBox().center(), occluders, m, {}, nullptr)) {
      (p.position_m.y() < 0.05 ? left : right) += 1;
    }
    return std::pair(left, right);
  };
  for (const auto frame : {ObstacleFrame::kPart, ObstacleFrame::kStage, ObstacleFrame::kWorld}) {
    const auto [left, right] = count(frame);
    EXPECT_EQ(left, 0);
    EXPECT_GT(right, 5000);
  }
}

}  // namespace
}  // namespace sightline
