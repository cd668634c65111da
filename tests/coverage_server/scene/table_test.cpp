// SPDX-License-Identifier: Apache-2.0
// Parts on a table: what hides behind it, what cannot be measured on it, and limits of scans.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/physics/angle.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/scene/coverage_scene.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

// A roof 60 mm over the table, 120 x 120 x 10 mm, on a post.
TriangleMesh Mushroom() {
  return Merged(BoxMesh({-0.01f, -0.01f, 0}, {0.01f, 0.01f, 0.0601f}),
                BoxMesh({-0.06f, -0.06f, 0.06f}, {0.06f, 0.06f, 0.07f}));
}

TriangleMesh Table(float half_m = 0.3f) {
  return BoxMesh({-half_m, -half_m, -0.02f}, {half_m, half_m, 0});
}

SceneDefinition Definition(TriangleMesh part) {
  SceneDefinition definition;
  definition.part = std::move(part);
  definition.sampling.spacing_m = 0.004;
  definition.field_directions = 576;
  return definition;
}

// Counts the targets that face a direction, and those of them with a bit.
std::pair<int, int> Facing(const CoverageScene& scene, const Eigen::Vector3f& direction,
                           const TargetBits& bits) {
  std::pair<int, int> count{0, 0};
  for (size_t t = 0; t < scene.targets().size(); ++t) {
    if (scene.targets().normals[t].dot(direction) < 0.9f) continue;
    ++count.second;
    count.first += bits.Test(t);
  }
  return count;
}

// Camera level with the roof, laser far below it.
Measurement FromBelow() {
  Measurement m;
  m.camera_distance_m = 0.4;
  m.camera_polar_rad = 88 * kRadPerDeg;
  m.triangulation_angle_rad = -60 * kRadPerDeg;
  m.offset_z_m = 0.06;
  return m;
}

TEST(Table, HidesWhatSensorsBelowItWouldSee) {
  for (const bool with_table : {false, true}) {
    SceneDefinition definition = Definition(Mushroom());
    definition.rig.camera_bodies.clear();
    definition.rig.laser_bodies.clear();
    if (with_table) definition.obstacles.push_back({Table(), ObstacleFrame::kTable});
    const auto scene = BuildScene(std::move(definition), 2);
    ASSERT_NE(scene, nullptr);
    const Measurement m = FromBelow();
    const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
    FastCoverage fast;
    scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
    const Eigen::Vector3f down(0, 0, -1);
    const auto [exact_below, below] = Facing(*scene, down, exact.covered);
    const auto [fast_below, same] = Facing(*scene, down, fast.covered);
    ASSERT_GT(below, 300);
    if (with_table) {
      EXPECT_EQ(exact_below, 0);
      EXPECT_EQ(fast_below, 0);
    } else {
      EXPECT_GT(exact_below, below / 4);
      EXPECT_NEAR(fast_below, exact_below, 0.1 * below);
    }
  }
}

TEST(Table, FastAndExactAgreeBesideABoxThatLiesOnIt) {
  SceneDefinition definition = Definition(BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.05f}));
  definition.rig.camera_bodies.clear();
  definition.rig.laser_bodies.clear();
  definition.obstacles.push_back({Table(), ObstacleFrame::kTable});
  definition.obstacles.push_back(
      {BoxMesh({0.07f, -0.1f, 0}, {0.09f, 0.1f, 0.12f}), ObstacleFrame::kTable});
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  Random random(5);
  double error = 0;
  int hidden = 0;
  constexpr int kScans = 60;
  for (int i = 0; i < kScans; ++i) {
    Measurement m = RandomMeasurement(random);
    m.part_alpha_rad = i % 2 == 0 ? 0 : std::numbers::pi / 2;
    m.part_beta_rad = 0;
    const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
    FastCoverage fast;
    scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
    if (exact.feasibility != Feasibility::kFeasible || fast.feasibility != Feasibility::kFeasible) {
      ++hidden;
      continue;
    }
    error += std::abs(static_cast<double>(exact.covered.Count() - fast.covered.Count())) /
             static_cast<double>(scene->targets().size());
  }
  EXPECT_LT(hidden, kScans / 2);
  EXPECT_LT(error / (kScans - hidden), 0.01);
}

TEST(Table, WhatTravelsAlongMayCarryThePartButNotCutIt) {
  SceneDefinition definition = Definition(BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.05f}));
  // At the height of the part's centre; and just under it.
  for (const auto& [top_m, expected] :
       {std::pair(0.0f, Feasibility::kCollision), std::pair(-0.025f, Feasibility::kFeasible)}) {
    SceneDefinition on_plate = definition;
    on_plate.obstacles.push_back(
        {BoxMesh({-0.2f, -0.2f, -0.1f}, {0.2f, 0.2f, top_m}), ObstacleFrame::kStage});
    const auto scene = BuildScene(std::move(on_plate), 2);
    ASSERT_NE(scene, nullptr);
    EXPECT_EQ(scene->EvaluateExact(OverheadMeasurement(0.5), nullptr, nullptr).feasibility,
              expected);
  }
}

TEST(Table, StandsUnderThePartInEveryOrientation) {
  const TriangleMesh part = BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.05f});
  SceneDefinition definition = Definition(part);
  definition.obstacles.push_back({Table(), ObstacleFrame::kTable});
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  // A sensor's body hits it where it reaches below the lowest corner.
  Random random(7);
  for (int i = 0; i < 200; ++i) {
    Measurement m = RandomMeasurement(random);
    const ScanGeometry g = MakeScanGeometry(scene->rig(), m);
    double lowest_m = 1e9;
    for (const Eigen::Vector3f& p : part.positions_m) {
      lowest_m =
          std::min(lowest_m, (g.part_rotation * (p.cast<double>() - scene->part_centre_m())).z());
    }
    EXPECT_NEAR(g.table_height_m, lowest_m, 1e-9);
  }
}

TEST(DomainMeasurability, TheFaceThatAPartLiesOnNeedsAnotherRest) {
  const auto measurable = [](std::vector<RestingOrientation> rests, bool with_domain) {
    SceneDefinition definition = Definition(BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.05f}));
    definition.obstacles.push_back({Table(), ObstacleFrame::kTable});
    if (with_domain) {
      definition.domain = ThesisDomain();
      definition.domain->resting_orientations = std::move(rests);
    }
    return BuildScene(std::move(definition), 2);
  };
  const Eigen::Vector3f down(0, 0, -1);
  const auto anywhere = measurable({}, false);
  EXPECT_EQ(anywhere->measurable().Count(), static_cast<int64_t>(anywhere->targets().size()));

  const auto one = measurable({{0, 0}}, true);
  const auto [below, of] = Facing(*one, down, one->measurable());
  EXPECT_GT(of, 200);
  EXPECT_EQ(below, 0);
  EXPECT_EQ(one->measurable().Count(), static_cast<int64_t>(one->targets().size()) - of);
  EXPECT_EQ(one->measurable_in_free_space().Count(), static_cast<int64_t>(one->targets().size()));

  const auto two = measurable({{0, 0}, {std::numbers::pi, 0}}, true);
  EXPECT_EQ(two->measurable().Count(), static_cast<int64_t>(two->targets().size()));
  // On its side both large faces are free.
  const auto side = measurable({{std::numbers::pi / 2, 0}}, true);
  const auto [side_below, side_of] = Facing(*side, down, side->measurable());
  EXPECT_EQ(side_below, side_of);
}

// However the part lies, there is no room for both sensors near it and at small angles.
TEST(DomainMeasurability, BodiesOfCameraAndLaserNeedRoom) {
  const auto measurable = [](double distance_m, std::vector<RestingOrientation> rests) {
    SceneDefinition definition = Definition(BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.05f}));
    definition.domain = ThesisDomain();
    definition.domain->parameters[0] = {.ranges = {}, .values = {distance_m}};
    definition.domain->parameters[1] = {.ranges = {{10 * kRadPerDeg, 14 * kRadPerDeg}},
                                        .values = {}};
    definition.domain->resting_orientations = std::move(rests);
    return BuildScene(std::move(definition), 2)->measurable().Count();
  };
  EXPECT_EQ(measurable(0.15, {}), 0);
  EXPECT_EQ(measurable(0.15, {{0, 0}}), 0);
  EXPECT_GT(measurable(0.4, {}), 0);
  EXPECT_GT(measurable(0.4, {{0, 0}}), 0);
}

TEST(DomainMeasurability, LimitsAndDomainsLeaveNothingThatScansMeasure) {
  // Every target that exact scans of the domain cover is measurable.
  SceneDefinition definition = Definition(Mushroom());
  definition.obstacles.push_back({Table(), ObstacleFrame::kTable});
  definition.domain = ThesisDomain();
  definition.domain->resting_orientations = {{0, 0}, {std::numbers::pi / 2, 0}};
  definition.domain->parameters[0] = {.ranges = {{0.3, 0.5}}, .values = {}, .periodic = false};
  definition.domain->parameters[3] = {
      .ranges = {{0, 50 * kRadPerDeg}}, .values = {}, .periodic = false};
  definition.sampling.max_depth_per_pixel_m = 0.002;
  const MeasurementDomain domain = *definition.domain;
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  EXPECT_LT(scene->measurable().Count(), scene->measurable_in_free_space().Count());
  Random random(3);
  TargetBits covered(scene->targets().size());
  for (int i = 0; i < 150; ++i) {
    Measurement m;
    m.camera_distance_m = random.Uniform(0.3, 0.5);
    m.triangulation_angle_rad = random.Uniform(10, 80) * kRadPerDeg * (i % 2 == 0 ? 1 : -1);
    m.camera_polar_rad = random.Uniform(0, 50) * kRadPerDeg;
    m.part_alpha_rad = i % 3 == 0 ? std::numbers::pi / 2 : 0;
    m.part_gamma_rad = random.Uniform(0, 360) * kRadPerDeg;
    m.offset_z_m = random.Uniform(-0.05, 0.05);
    ASSERT_TRUE(domain.Contains(m));
    const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
    covered |= exact.covered;
  }
  EXPECT_GT(covered.Count(), scene->measurable().Count() / 2);
  // Targets are covered from up to a coverage radius away, around edges too.
  EXPECT_LT(covered.CountNotIn(scene->measurable()), covered.Count() / 100);
}

// A ray that reaches the wall of a slot of width w at depth h through the opening has at most the
// cosine 1 / sqrt(1 + (h / w)^2) to the wall's normal: at 70 degrees it reaches h = 2.75 w.
TEST(FreeSpaceMeasurability, IncidenceLimitsTheDepthInASlot) {
  constexpr float kHalfWidth_m = 0.005f, kTop_m = 0.06f;
  const double deepest_m = 2 * kHalfWidth_m * std::tan(70 * kRadPerDeg);
  const TriangleMesh part =
      Merged(BoxMesh({-0.02f, -0.06f, -0.01f}, {0.02f, 0.06f, 0}),
             Merged(BoxMesh({-0.02f, -0.06f, 0}, {-kHalfWidth_m, 0.06f, kTop_m}),
                    BoxMesh({kHalfWidth_m, -0.06f, 0}, {0.02f, 0.06f, kTop_m})));
  SceneDefinition definition = Definition(part);
  definition.field_directions = 4096;
  for (const bool with_domain : {false, true}) {
    if (with_domain) definition.domain = ThesisDomain();
    definition.sampling.max_incidence_rad = 70 * kRadPerDeg;
    const auto scene = BuildScene(definition, 2);
    ASSERT_NE(scene, nullptr);
    int shallow = 0, deep = 0;
    for (size_t t = 0; t < scene->targets().size(); ++t) {
      const Eigen::Vector3f& at = scene->targets().positions_m[t];
      const bool wall = std::abs(std::abs(at.x()) - kHalfWidth_m) < 1e-5f && at.z() > 0.005f;
      // Rays through the ends of the slot reach 2.75 w along it too.
      if (!wall || std::abs(at.y()) > 0.025f) continue;
      const double depth_m = kTop_m - at.z();
      EXPECT_TRUE(scene->measurable_in_free_space().Test(t));
      if (depth_m < 0.8 * deepest_m) {
        ++shallow;
        EXPECT_TRUE(scene->measurable().Test(t)) << depth_m;
      } else if (depth_m > 1.1 * deepest_m) {
        ++deep;
        EXPECT_FALSE(scene->measurable().Test(t)) << depth_m;
      }
    }
    EXPECT_GT(shallow, 20);
    EXPECT_GT(deep, 20);
  }
}

TEST(DepthPerPixel, LimitsEveryPointByItsOwnAngle) {
  const TriangleMesh part = SteppedPart();
  const auto points_with = [&](std::optional<double> limit_m, FastCoverage* fast) {
    SceneDefinition definition = Definition(part);
    definition.sampling.max_depth_per_pixel_m = limit_m;
    const auto scene = BuildScene(std::move(definition), 2);
    Measurement m = OverheadMeasurement(20 * kRadPerDeg);
    m.camera_polar_rad = 10 * kRadPerDeg;
    std::vector<MeasurementPoint> points;
    scene->EvaluateExact(m, &points, nullptr);
    scene->EvaluateFastCoverage({&m, 1}, {fast, 1}, nullptr);
    // Evaluates each point by its definition.
    const ScanGeometry g = MakeScanGeometry(scene->rig(), m);
    int finer = 0;
    for (const MeasurementPoint& p : points) {
      const Eigen::Vector3d at = PartToWorld(g, scene->part_centre_m(), p.position_m.cast<double>(),
                                             p.frame * scene->rig().scan_step_m);
      const Eigen::Vector3d sight = at - g.camera.origin_m;
      const double footprint_m = sight.dot(g.camera.z_axis) / scene->rig().camera.FocalLengthPx();
      const double sine = std::abs(sight.normalized().dot(g.sheet_normal));
      finer += footprint_m / sine <= 0.0019;
      if (limit_m) {
        EXPECT_LE(footprint_m / sine, *limit_m * (1 + 1e-5));
      }
    }
    return std::pair(static_cast<int>(points.size()), finer);
  };
  FastCoverage all, fine;
  const auto [total, finer] = points_with(std::nullopt, &all);
  const auto [kept, kept_finer] = points_with(0.0019, &fine);
  EXPECT_GT(finer, total / 10);
  EXPECT_LT(finer, total * 9 / 10);
  EXPECT_NEAR(kept, finer, 1e-3 * total);
  EXPECT_EQ(kept, kept_finer);
  const double share = static_cast<double>(fine.covered.Count()) /
                       static_cast<double>(std::max<int64_t>(1, all.covered.Count()));
  EXPECT_NEAR(share, static_cast<double>(finer) / total, 0.15);
}

}  // namespace
}  // namespace sightline
