// SPDX-License-Identifier: Apache-2.0
// Targets that are measurable with a rig, against closed forms and against scans.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/physics/angle.h"
#include "coverage_server/scene/coverage_scene.h"
#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

// Half a sphere of 40 mm radius; its facets are 1.5 degrees high.
TriangleMesh Dome() {
  constexpr int kRings = 60;
  constexpr double kRadius_m = 0.04;
  std::vector<Eigen::Vector2d> profile = {{0, 0}};
  for (int i = 0; i <= kRings; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / kRings;
    profile.push_back({i == kRings ? 0 : kRadius_m * std::cos(angle), kRadius_m * std::sin(angle)});
  }
  return Lathe(profile, 90);
}

double SlopeOf(const CoverageScene& scene, size_t target) {
  return std::acos(std::clamp<double>(scene.targets().normals[target].z(), -1, 1));
}

// The camera looks straight down, the laser comes from 30 degrees, the field of view is 1 degree
// wide: a surface of slope s is seen under s, and lit under s - 30 degrees at best. So it counts if
// and only if s is at most the limit and half the field of view more.
TEST(DomainMeasurability, KeepsTheLimitOfIncidence) {
  for (const double limit_deg : {40.0, 55.0, 70.0}) {
    SceneDefinition definition;
    definition.part = Dome();
    definition.sampling.spacing_m = 0.0015;
    definition.sampling.max_incidence_rad = limit_deg * kRadPerDeg;
    definition.rig.camera.vertical_fov_rad = 1 * kRadPerDeg;
    definition.field_directions = 1024;
    definition.domain = ThesisDomain();
    definition.domain->resting_orientations = {{0, 0}};
    definition.domain->parameters[kCameraPolar] = {.ranges = {}, .values = {0}};
    definition.domain->parameters[kTriangulationAngle] = {
        .ranges = {}, .values = {-30 * kRadPerDeg, 30 * kRadPerDeg}};
    const auto scene = BuildScene(std::move(definition), 2);
    ASSERT_NE(scene, nullptr);
    int above = 0, near_below = 0;
    for (size_t t = 0; t < scene->targets().size(); ++t) {
      const double slope_deg = SlopeOf(*scene, t) / kRadPerDeg;
      if (slope_deg > 89) continue;  // the base
      if (slope_deg > limit_deg + 0.51) {
        EXPECT_FALSE(scene->measurable().Test(t)) << slope_deg;
        above += slope_deg < limit_deg + 5;
      } else if (slope_deg < limit_deg - 0.1) {
        EXPECT_TRUE(scene->measurable().Test(t)) << slope_deg;
        near_below += slope_deg > limit_deg - 5;
      }
    }
    EXPECT_GT(above, 50);
    EXPECT_GT(near_below, 50);
  }
}

// Every target of a box or a stepped shaft that counts is measured by some scan of the domain: the
// explanation searches for one, without the grid that measurability uses.
TEST(DomainMeasurability, HasAScanForEveryTargetOfSimpleParts) {
  const TriangleMesh parts[] = {BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.05f}), SteppedPart()};
  for (const TriangleMesh& part : parts) {
    SceneDefinition definition;
    definition.part = part;
    definition.sampling.spacing_m = 0.006;
    definition.sampling.max_incidence_rad = 70 * kRadPerDeg;
    definition.sampling.max_pixel_footprint_m = 0.0015;
    definition.sampling.max_depth_per_pixel_m = 0.003;
    definition.field_directions = 1024;
    definition.obstacles.push_back(
        {BoxMesh({-0.2f, -0.2f, -0.02f}, {0.2f, 0.2f, 0}), ObstacleFrame::kTable});
    definition.domain = ThesisDomain();
    definition.domain->resting_orientations = {{0, 0}, {std::numbers::pi, 0}};
    const MeasurementDomain domain = *definition.domain;
    const auto scene = BuildScene(std::move(definition), 2);
    ASSERT_NE(scene, nullptr);
    std::vector<uint32_t> counted;
    for (uint32_t t = 0; t < scene->targets().size(); ++t) {
      if (scene->measurable().Test(t)) counted.push_back(t);
    }
    std::vector<TargetExplanation> reasons(counted.size());
    scene->Explain(domain, counted, reasons, nullptr);
    const auto without_scan = std::count_if(reasons.begin(), reasons.end(), [](const auto& r) {
      return r.reason != UncoveredReason::kNotChosen;
    });
    EXPECT_GT(counted.size(), scene->targets().size() / 2);
    EXPECT_EQ(without_scan, 0) << "of " << counted.size();
  }
}

TEST(DomainMeasurability, SaysFromWhichOrientationsATargetIsMeasurable) {
  SceneDefinition definition;
  definition.part = BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.05f});
  definition.sampling.spacing_m = 0.006;
  definition.field_directions = 576;
  definition.obstacles.push_back(
      {BoxMesh({-0.2f, -0.2f, -0.02f}, {0.2f, 0.2f, 0}), ObstacleFrame::kTable});
  definition.domain = ThesisDomain();
  definition.domain->resting_orientations = {{0, 0}, {std::numbers::pi, 0}};
  const auto scene = BuildScene(std::move(definition), 2);
  ASSERT_NE(scene, nullptr);
  const auto orientations = scene->measurable_orientations();
  ASSERT_EQ(orientations.size(), scene->targets().size());
  for (size_t t = 0; t < orientations.size(); ++t) {
    EXPECT_EQ(orientations[t] != 0, scene->measurable().Test(t));
    const float up = scene->targets().normals[t].z();
    if (up > 0.9f) {
      EXPECT_EQ(orientations[t], 1u);
    }
    if (up < -0.9f) {
      EXPECT_EQ(orientations[t], 2u);
    }
  }
}

}  // namespace
}  // namespace sightline
