// SPDX-License-Identifier: Apache-2.0
// Targets that the light of their material limits: a table that forbids steep directions is a limit
// on the incidence, materials have their own tables, and reasons name the exposure.
#include "coverage_server/detectability/light_limit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/physics/angle.h"
#include "coverage_server/detectability/light_map.h"
#include "coverage_server/scene/coverage_scene.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Shows the line with 1 ms up to an incidence of camera and laser, with no exposure beyond.
MaterialExposures UpTo(double incidence_rad, const std::string& name = "") {
  MaterialExposures material;
  material.part_material = name;
  material.camera_distances_m = {1};
  material.camera_incidence_rad =
      material.laser_incidence_rad = {0, incidence_rad, incidence_rad + 1e-6};
  material.azimuth_rad = {0};
  material.laser_distance_m = 1;
  for (int camera = 0; camera < 3; ++camera) {
    for (int laser = 0; laser < 3; ++laser) {
      const bool shows = camera < 2 && laser < 2;
      material.shortest_s.push_back(shows ? 1e-6 : kInfinity);
      material.longest_s.push_back(kInfinity);
    }
  }
  return material;
}

// The same times from everywhere.
MaterialExposures Always(double shortest_s, double longest_s, const std::string& name = "") {
  MaterialExposures material;
  material.part_material = name;
  material.camera_distances_m = {1};
  material.camera_incidence_rad = material.laser_incidence_rad = material.azimuth_rad = {0};
  material.laser_distance_m = 1;
  material.shortest_s = {shortest_s};
  material.longest_s = {longest_s};
  return material;
}

Detectability With(std::vector<MaterialExposures> materials) {
  Detectability detectability;
  detectability.min_exposure_time_s = 1e-4;
  detectability.max_exposure_time_s = 1e-2;
  detectability.materials = std::move(materials);
  return detectability;
}

SceneDefinition Sphere() {
  constexpr int kRings = 90;
  constexpr double kRadius_m = 0.04;
  std::vector<Eigen::Vector2d> profile;
  for (int i = 0; i <= kRings; ++i) {
    const double angle = std::numbers::pi * (static_cast<double>(i) / kRings - 0.5);
    profile.push_back(
        {i == 0 || i == kRings ? 0 : kRadius_m * std::cos(angle), kRadius_m * std::sin(angle)});
  }
  SceneDefinition definition;
  definition.part = Lathe(profile, 120);
  definition.sampling.spacing_m = 0.003;
  definition.sampling.coverage_radius_m = 0.002;
  definition.field_directions = 1024;
  return definition;
}

TEST(LightLimit, ForbiddenIncidenceCoversLikeALimitOnIncidence) {
  const double limit_rad = 50 * kRadPerDeg;
  SceneDefinition steep = Sphere(), dark = Sphere();
  steep.sampling.max_incidence_rad = limit_rad;
  dark.detectability = With({UpTo(limit_rad)});
  const auto by_angle = BuildScene(std::move(steep), 2), by_light = BuildScene(std::move(dark), 2);
  ASSERT_NE(by_angle, nullptr);
  ASSERT_NE(by_light, nullptr);
  Random random(5);
  int64_t covered = 0, exact_differs = 0, fast_differs = 0;
  for (int i = 0; i < 30; ++i) {
    const Measurement m = RandomMeasurement(random);
    const ExactCoverage a = by_angle->EvaluateExact(m, nullptr, nullptr),
                        b = by_light->EvaluateExact(m, nullptr, nullptr);
    if (a.feasibility != Feasibility::kFeasible || b.feasibility != Feasibility::kFeasible)
      continue;
    covered += b.covered.Count();
    exact_differs += a.covered.CountNotIn(b.covered) + b.covered.CountNotIn(a.covered);
    FastCoverage fast;
    by_light->EvaluateFastCoverage({&m, 1}, {&fast, 1}, nullptr);
    fast_differs += fast.covered.CountNotIn(b.covered) + b.covered.CountNotIn(fast.covered);
  }
  EXPECT_GT(covered, 1000);
  EXPECT_EQ(exact_differs, 0);
  // Steps of the map are about two degrees.
  EXPECT_LT(fast_differs, 0.05 * static_cast<double>(covered)) << "of " << covered;
}

TEST(LightLimit, MapAgreesWithTheTable) {
  // A matt surface: times are those of the cosine of the laser's incidence.
  MaterialExposures material = Always(1, 1);
  material.camera_distances_m = {0.3, 0.7};
  material.laser_incidence_rad.clear();
  material.shortest_s.clear();
  material.longest_s.clear();
  for (int i = 0; i <= 17; ++i) material.laser_incidence_rad.push_back(5 * i * kRadPerDeg);
  for (const double distance_m : material.camera_distances_m) {
    for (const double laser : material.laser_incidence_rad) {
      material.shortest_s.push_back(1e-2 * distance_m / std::cos(laser));
      material.longest_s.push_back(kInfinity);
    }
  }
  const LightLimit limit(With({material}), Sphere().part);
  const LightMap map(limit);
  Random random(3);
  int differ = 0, shown = 0;
  constexpr int kPlaces = 20000;
  for (int i = 0; i < kPlaces; ++i) {
    const double camera = random.Uniform(0.02, 1), laser = random.Uniform(0.02, 1);
    const double between = camera * laser + std::sqrt((1 - camera * camera) * (1 - laser * laser)) *
                                                std::cos(random.Uniform(0, std::numbers::pi));
    const double distance_m = random.Uniform(0.2, 0.8), laser_m = random.Uniform(0.3, 1.5);
    const bool exact =
        limit.At(0, distance_m, laser_m, camera, laser, between).verdict == LightVerdict::kDetected;
    shown += exact;
    differ += exact != map.Detects(0, static_cast<float>(distance_m), static_cast<float>(laser_m),
                                   static_cast<float>(camera), static_cast<float>(laser),
                                   static_cast<float>(between));
  }
  EXPECT_GT(shown, kPlaces / 4);
  EXPECT_LT(shown, kPlaces * 3 / 4);
  EXPECT_LT(differ, 0.03 * kPlaces);
}

// Two boxes side by side, of one material each.
SceneDefinition TwoMaterials() {
  SceneDefinition definition;
  const TriangleMesh left = BoxMesh({-0.05f, -0.02f, 0}, {-0.01f, 0.02f, 0.04f});
  definition.part = Merged(left, BoxMesh({0.01f, -0.02f, 0}, {0.05f, 0.02f, 0.04f}));
  definition.part.material_names = {"bright", "black"};
  for (size_t t = 0; t < definition.part.triangles.size(); ++t) {
    definition.part.triangle_material.push_back(t < left.triangles.size() ? 0 : 1);
  }
  definition.sampling.spacing_m = 0.006;
  definition.field_directions = 256;
  return definition;
}

TEST(LightLimit, MaterialsHaveTheirOwnTables) {
  SceneDefinition definition = TwoMaterials();
  definition.detectability = With({Always(1e-3, 1, "bright"), Always(0.5, 1, "black")});
  for (const bool free_space : {true, false}) {
    if (!free_space) {
      definition.domain = ThesisDomain();
      definition.domain->resting_orientations = {{0, 0}};
    }
    const auto scene = BuildScene(definition, 2);
    ASSERT_NE(scene, nullptr);
    int bright = 0;
    for (size_t t = 0; t < scene->targets().size(); ++t) {
      if (scene->targets().positions_m[t].x() > 0) {
        EXPECT_FALSE(scene->measurable().Test(t));
      } else {
        bright += scene->measurable().Test(t);
      }
      // Without regard to light.
      EXPECT_TRUE(free_space || !scene->measurable().Test(t) ||
                  scene->measurable_in_free_space().Test(t));
    }
    EXPECT_GT(bright, 50);
    EXPECT_GT(scene->measurable_in_free_space().Count(), scene->measurable().Count());
    const ExactCoverage coverage = scene->EvaluateExact(OverheadMeasurement(0.5), nullptr, nullptr);
    ASSERT_EQ(coverage.feasibility, Feasibility::kFeasible);
    EXPECT_GT(coverage.covered.Count(), 0);
    for (size_t t = 0; t < scene->targets().size(); ++t) {
      if (scene->targets().positions_m[t].x() > 0) {
        EXPECT_FALSE(coverage.covered.Test(t));
      }
    }
  }
}

// No entry without a name: the other surface is not limited.
TEST(LightLimit, MaterialsWithoutATableAreNotLimited) {
  SceneDefinition definition = TwoMaterials();
  const auto free = BuildScene(definition, 2);
  definition.detectability = With({Always(1e-3, 1, "bright")});
  const auto limited = BuildScene(definition, 2);
  ASSERT_NE(free, nullptr);
  ASSERT_NE(limited, nullptr);
  EXPECT_TRUE(free->measurable() == limited->measurable());
}

TEST(LightLimit, ReasonsNameTheExposure) {
  const struct {
    MaterialExposures black;
    UncoveredReason reason;
    double least_s, most_s;
  } cases[] = {
      // At laser distances of 0.2 to 1 m.
      {Always(0.4, 1, "black"), UncoveredReason::kTooDark, 0.05, 0.4},
      {Always(kInfinity, kInfinity, "black"), UncoveredReason::kTooDark, kInfinity, kInfinity},
      {Always(1e-7, 5e-5, "black"), UncoveredReason::kTooBright, 1e-5, 1e-4},
  };
  for (const auto& expected : cases) {
    SceneDefinition definition = TwoMaterials();
    definition.rig.laser.distance_m = 0.5;
    definition.detectability = With({Always(1e-3, 1), expected.black});
    definition.domain = ThesisDomain();
    definition.domain->resting_orientations = {{0, 0}};
    const MeasurementDomain domain = *definition.domain;
    const auto scene = BuildScene(std::move(definition), 2);
    ASSERT_NE(scene, nullptr);
    std::vector<uint32_t> tops;
    for (uint32_t t = 0; t < scene->targets().size(); ++t) {
      if (scene->targets().normals[t].z() > 0.9f) tops.push_back(t);
    }
    std::vector<TargetExplanation> reasons(tops.size());
    scene->Explain(domain, tops, reasons, nullptr);
    int black = 0;
    for (size_t i = 0; i < tops.size(); ++i) {
      if (scene->targets().positions_m[tops[i]].x() < 0) {
        EXPECT_EQ(reasons[i].reason, UncoveredReason::kNotChosen);
        EXPECT_EQ(reasons[i].exposure_time_s, 0);
        continue;
      }
      ++black;
      EXPECT_EQ(reasons[i].reason, expected.reason);
      EXPECT_GE(reasons[i].exposure_time_s, expected.least_s);
      EXPECT_LE(reasons[i].exposure_time_s, expected.most_s);
    }
    EXPECT_GT(black, 10);
  }
}

}  // namespace
}  // namespace sightline
