// SPDX-License-Identifier: Apache-2.0
#include "tests/coverage_server/test_parts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <utility>

#include "core/part/load_part.h"

namespace sightline {

TriangleMesh Lathe(const std::vector<Eigen::Vector2d>& profile_m, int sides) {
  TriangleMesh mesh;
  std::vector<std::vector<uint32_t>> rings;
  for (const Eigen::Vector2d& p : profile_m) {
    std::vector<uint32_t> ring(sides);
    for (int j = 0; j < sides; ++j) {
      if (j == 0 || p.x() > 0) {
        const double angle = 2 * std::numbers::pi * j / sides;
        mesh.positions_m.emplace_back(static_cast<float>(p.x() * std::cos(angle)),
                                      static_cast<float>(p.x() * std::sin(angle)),
                                      static_cast<float>(p.y()));
      }
      ring[j] = static_cast<uint32_t>(mesh.positions_m.size() - 1);
    }
    rings.push_back(std::move(ring));
  }
  for (size_t i = 0; i + 1 < rings.size(); ++i) {
    for (int j = 0; j < sides; ++j) {
      const int k = (j + 1) % sides;
      const uint32_t a = rings[i][j], b = rings[i][k], c = rings[i + 1][k], d = rings[i + 1][j];
      if (a != b) mesh.triangles.push_back({a, b, c});
      if (c != d) mesh.triangles.push_back({a, c, d});
    }
  }
  return mesh;
}

namespace {

// Points between the corners so that triangles stay compact.
std::vector<Eigen::Vector2d> Subdivided(const std::vector<Eigen::Vector2d>& corners,
                                        double spacing_m) {
  std::vector<Eigen::Vector2d> points;
  for (size_t i = 0; i + 1 < corners.size(); ++i) {
    const int pieces =
        std::max(1, static_cast<int>(std::ceil((corners[i + 1] - corners[i]).norm() / spacing_m)));
    for (int k = 0; k < pieces; ++k) {
      points.push_back(corners[i] + (corners[i + 1] - corners[i]) * k / pieces);
    }
  }
  points.push_back(corners.back());
  return points;
}

}  // namespace

TriangleMesh SteppedPart() {
  return Lathe(Subdivided({{0, 0},
                           {0.06, 0},
                           {0.06, 0.02},
                           {0.04, 0.02},
                           {0.04, 0.04},
                           {0.02, 0.04},
                           {0.02, 0.06},
                           {0, 0.06}},
                          0.008),
               48);
}

TriangleMesh BlindHolePart() {
  return Lathe(
      Subdivided({{0, 0}, {0.04, 0}, {0.04, 0.05}, {0.015, 0.05}, {0.015, 0.025}, {0, 0.025}},
                 0.006),
      48);
}

TriangleMesh HolePart(double outer_m, double height_m, double hole_diameter_m, double hole_depth_m,
                      int sides) {
  const double r = 0.5 * hole_diameter_m, floor = height_m - hole_depth_m;
  return Lathe(
      {{0, 0}, {outer_m / 2, 0}, {outer_m / 2, height_m}, {r, height_m}, {r, floor}, {0, floor}},
      sides);
}

TriangleMesh CylinderHead() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  const std::filesystem::path root =
      source != nullptr ? std::filesystem::path(source)
                        : std::filesystem::path(__FILE__).parent_path() / ".." / "..";
  auto part = LoadPart((root / "examples" / "cylinder_head" / "cylinder_head.glb").string(), "");
  EXPECT_TRUE(part.ok()) << part.status();
  return part.ok() ? *part : TriangleMesh();
}

uint64_t Random::Next() {
  uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

double Random::Uniform(double low, double high) {
  return low + (high - low) * (static_cast<double>(Next() >> 11) * 0x1p-53);
}

Eigen::Vector3d Random::Direction() {
  const double z = Uniform(-1, 1), angle = Uniform(0, 2 * std::numbers::pi);
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

Measurement RandomMeasurement(Random& random) {
  constexpr double kDegree = std::numbers::pi / 180;
  Measurement m;
  m.camera_distance_m = random.Uniform(0.2, 0.6);
  m.triangulation_angle_rad = random.Uniform(10, 60) * kDegree * (random.Next() & 1 ? 1 : -1);
  m.camera_azimuth_rad = random.Uniform(0, 360) * kDegree;
  m.camera_polar_rad = random.Uniform(0, 60) * kDegree;
  m.part_alpha_rad = random.Uniform(0, 360) * kDegree;
  m.part_beta_rad = random.Uniform(0, 360) * kDegree;
  m.part_gamma_rad = random.Uniform(0, 360) * kDegree;
  m.offset_y_m = random.Uniform(-0.1, 0.1);
  m.offset_z_m = random.Uniform(-0.1, 0.1);
  return m;
}

Measurement OverheadMeasurement(double tau_rad) {
  Measurement m;
  m.camera_distance_m = 0.4;
  m.triangulation_angle_rad = tau_rad;
  return m;
}

std::vector<Occluder> PartOccluder(const TriangleMesh& part) {
  std::vector<Occluder> occluders;
  occluders.push_back({ObstacleFrame::kPart, TriangleBvh(part)});
  return occluders;
}

std::unique_ptr<CoverageScene> BuildScene(SceneDefinition definition, int threads) {
  SceneBuildOptions options;
  options.threads = threads;
  auto scene = CoverageScene::Build(std::move(definition), options);
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? std::move(*scene) : nullptr;
}

}  // namespace sightline
