// SPDX-License-Identifier: Apache-2.0
// Meshes that a planner meets in practice: broken, open, tiny, huge.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/physics/angle.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

SceneDefinition Coarse(TriangleMesh part) {
  SceneDefinition definition;
  definition.part = std::move(part);
  definition.field_directions = 64;
  return definition;
}

// Broken triangles must change nothing.
TEST(Robustness, DegenerateAndDuplicateTrianglesChangeNothing) {
  const TriangleMesh sound = SteppedPart();
  TriangleMesh broken = sound;
  const auto count = static_cast<uint32_t>(sound.triangles.size());
  for (uint32_t t = 0; t < count; t += 5) {
    const auto [a, b, c] = sound.triangles[t];
    broken.triangles.push_back({a, b, b});  // an edge
    broken.triangles.push_back({a, a, a});  // a point
    broken.triangles.push_back({a, b, c});  // a duplicate
  }
  const auto build = [](const TriangleMesh& part) {
    SceneDefinition definition = Coarse(part);
    definition.rig.camera.columns_px = definition.rig.camera.rows_px = 128;
    definition.rig.scan_step_m = 0.004;
    return BuildScene(std::move(definition), 1);
  };
  const auto sound_scene = build(sound), broken_scene = build(broken);
  ASSERT_TRUE(sound_scene != nullptr && broken_scene != nullptr);
  for (size_t t = 0; t < broken_scene->targets().size(); ++t) {
    EXPECT_TRUE(broken_scene->targets().positions_m[t].allFinite());
    EXPECT_NEAR(broken_scene->targets().normals[t].norm(), 1, 1e-4);
  }
  Random random(71);
  int64_t points = 0;
  for (int i = 0; i < 12; ++i) {
    const Measurement m = RandomMeasurement(random);
    std::vector<MeasurementPoint> want, got;
    sound_scene->EvaluateExact(m, &want, nullptr);
    const ExactCoverage exact = broken_scene->EvaluateExact(m, &got, nullptr);
    points += static_cast<int64_t>(want.size());
    // The same places; a duplicate may be measured twice.
    size_t k = 0;
    for (const auto& p : want) {
      while (k < got.size() && (got[k].frame != p.frame || got[k].column_px != p.column_px ||
                                (got[k].position_m - p.position_m).norm() > 1e-7f)) {
        ++k;
      }
      ASSERT_LT(k, got.size());
    }
    for (const auto& p : got) EXPECT_TRUE(p.position_m.allFinite() && p.normal.allFinite());
    FastCoverage fast;
    broken_scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
    if (exact.feasibility != Feasibility::kFeasible || fast.feasibility != Feasibility::kFeasible)
      continue;
    const auto targets = static_cast<double>(broken_scene->targets().size());
    // 64 directions are 20 degrees apart: a rough estimate.
    EXPECT_NEAR(static_cast<double>(fast.covered.Count()) / targets,
                static_cast<double>(exact.covered.Count()) / targets, 0.1);
  }
  EXPECT_GT(points, 1000);
}

// A sheet with one side: measured from its front only, and hides what is behind it from both.
TEST(Robustness, OpenSheetHasOneSide) {
  TriangleMesh plate = PlateMesh(0.1, 0.1, 4, 4);
  const auto scene = BuildScene(Coarse(plate), 1);
  ASSERT_NE(scene, nullptr);
  const auto targets = static_cast<int64_t>(scene->targets().size());
  Measurement m = OverheadMeasurement(25 * kRadPerDeg);
  EXPECT_EQ(scene->EvaluateExact(m, nullptr, nullptr).covered.Count(), targets);
  EXPECT_EQ(scene->measurable().Count(), targets);
  FastCoverage fast;
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(fast.covered.Count(), targets);
  m.part_alpha_rad = std::numbers::pi;  // the back
  const ExactCoverage back = scene->EvaluateExact(m, nullptr, nullptr);
  EXPECT_EQ(back.covered.Count(), 0);
  EXPECT_EQ(back.measurement_points, 0);
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(fast.covered.Count(), 0);

  // A second sheet below, facing up, 20 mm away: hidden except what looks past the edge.
  TriangleMesh below = PlateMesh(0.02, 0.02, 2, 2);
  for (auto& p : below.positions_m) p += Eigen::Vector3f(0.04f, 0.04f, -0.005f);
  // The upper one turned over: its back is seen from above, and still hides.
  const TriangleMesh both = Merged(Flipped(plate), below);
  const auto hidden = BuildScene(Coarse(both), 1);
  ASSERT_NE(hidden, nullptr);
  m = OverheadMeasurement(25 * kRadPerDeg);
  EXPECT_EQ(hidden->EvaluateExact(m, nullptr, nullptr).covered.Count(), 0);
  hidden->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_EQ(fast.covered.Count(), 0);
}

TEST(Robustness, TinyPart) {
  SceneDefinition definition = Coarse(SphereMesh(0.001, 3));  // 2 mm across
  definition.sampling.spacing_m = 0.0002;
  definition.sampling.coverage_radius_m = 0.00015;
  definition.rig.scan_step_m = 0.00005;
  definition.rig.camera.vertical_fov_rad = 1 * kRadPerDeg;
  definition.field_directions = 256;
  const auto scene = BuildScene(std::move(definition), 1);
  ASSERT_NE(scene, nullptr);
  const auto targets = static_cast<double>(scene->targets().size());
  EXPECT_GT(targets, 200);
  Measurement m = OverheadMeasurement(30 * kRadPerDeg);
  m.camera_distance_m = 0.2;
  const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
  ASSERT_EQ(exact.feasibility, Feasibility::kFeasible);
  // Seen and lit from directions 30 degrees apart: a lune of 150 of 360 degrees.
  EXPECT_NEAR(static_cast<double>(exact.covered.Count()) / targets, 150.0 / 360, 0.06);
  FastCoverage fast;
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  EXPECT_NEAR(static_cast<double>(fast.covered.Count()) / targets, 150.0 / 360, 0.06);
  EXPECT_GT(static_cast<double>(scene->measurable().Count()), 0.99 * targets);
}

TEST(Robustness, HugePart) {
  SceneDefinition definition =
      Coarse(BoxMesh({-2.5f, -0.4f, -0.1f}, {2.5f, 0.4f, 0.1f}));  // 5 m long
  definition.sampling.spacing_m = 0.05;
  definition.sampling.coverage_radius_m = 0.03;
  definition.rig.scan_step_m = 0.01;
  definition.rig.stage_travel_m = 6;
  definition.field_directions = 256;
  const auto scene = BuildScene(std::move(definition), 1);
  ASSERT_NE(scene, nullptr);
  Measurement m = OverheadMeasurement(30 * kRadPerDeg);
  m.camera_distance_m = 0.8;
  m.offset_z_m = -0.1;  // upper face at the origin
  const ExactCoverage exact = scene->EvaluateExact(m, nullptr, nullptr);
  ASSERT_EQ(exact.feasibility, Feasibility::kFeasible);
  FastCoverage fast;
  scene->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
  // The upper face's strip in the field of view, 0.663 m wide, on either side widened by the
  // radius.
  int want = 0, exact_missing = 0, fast_missing = 0, beyond = 0;
  const double half = 0.8 * std::tan(22.5 * kRadPerDeg);
  for (size_t t = 0; t < scene->targets().size(); ++t) {
    if (scene->targets().normals[t].z() < 0.9f) continue;
    const double y = std::abs(static_cast<double>(scene->targets().positions_m[t].y()));
    if (y < half - 0.001) {
      ++want;
      exact_missing += !exact.covered.Test(t);
      fast_missing += !fast.covered.Test(t);
    }
    beyond += y > half + 0.031 && exact.covered.Test(t);
  }
  EXPECT_GT(want, 800);
  EXPECT_EQ(exact_missing, 0);
  EXPECT_LE(fast_missing, want / 200);
  EXPECT_EQ(beyond, 0);
}

TEST(Robustness, FewTargetsAndCancelledBuild) {
  SceneDefinition definition = Coarse(BoxMesh({0, 0, 0}, {0.004f, 0.004f, 0.004f}));
  definition.sampling.spacing_m = 0.02;
  const auto scene = BuildScene(std::move(definition), 4);
  ASSERT_NE(scene, nullptr);
  EXPECT_GE(scene->targets().size(), 1u);
  EXPECT_LE(scene->targets().size(), 64u);
  EXPECT_EQ(scene->measurable().Count(), static_cast<int64_t>(scene->targets().size()));
  EXPECT_FALSE(CoverageScene::Build(SceneDefinition{}, {}).ok());  // no triangles
  const std::atomic<bool> cancelled = true;
  SceneBuildOptions options;
  options.cancelled = &cancelled;
  EXPECT_EQ(CoverageScene::Build(Coarse(SteppedPart()), options).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace sightline
