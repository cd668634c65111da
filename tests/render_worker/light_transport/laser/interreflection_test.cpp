// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "render_worker/light_transport/laser/laser_beam.h"
#include "render_worker/light_transport/light_transport.h"
#include "render_worker/light_transport/reference_path_tracer.h"
#include "render_worker/light_transport/scene.h"
#include "tests/render_worker/light_transport/test_scenes.h"

namespace sightline {
namespace {

constexpr double kFloorAlbedo = 0.8, kWallAlbedo = 0.5;

// Floor z = 0 and wall y = 0, which meet along x. The line lies on the floor 10 mm before the wall.
SceneDescription Groove() {
  SceneDescription scene;
  SceneMesh mesh;
  mesh.mesh = Rectangle({0, -0.05, 0}, {0.1, 0, 0}, {0, 0.05, 0});
  scene.meshes.push_back(mesh);
  mesh.mesh = Rectangle({0, 0, 0.05}, {0.1, 0, 0}, {0, 0, 0.05});
  mesh.triangle_material = {1, 1};
  scene.meshes.push_back(mesh);
  scene.materials = {TestLambert(kFloorAlbedo), TestLambert(kWallAlbedo)};
  return scene;
}

SceneView GrooveView() {
  SceneView view;
  view.camera = Look({0, -0.3, 0.25}, {0, 0.3, -0.24}, {1, 0, 0});
  view.image_distance_m = 0.02;
  view.laser = Look({0, -0.01, 0.3}, {0, 0, -1}, {1, 0, 0});
  view.laser_source.fan_angle_rad = 20 * std::numbers::pi / 180;
  view.laser_source.power_w = 0.02;
  return view;
}

TransportSettings Settings(int samples, int bounces) {
  TransportSettings settings;
  settings.filter = false;
  settings.first_samples_per_px = 4 * samples;
  settings.laser_max_samples_per_px = samples;
  settings.max_bounces = bounces;
  settings.threads = 1;
  settings.laser_light_paths = 16384;
  return settings;
}

LaserTransport TraceLaser(const SceneDescription& scene, const SceneView& view,
                          const SubPixelGrid& grid, const TransportSettings& settings) {
  auto transport = LightTransport::Make(scene);
  EXPECT_TRUE(transport.ok()) << transport.status();
  auto traced = (*transport)->TraceLaser(view, grid, settings, {});
  EXPECT_TRUE(traced.ok()) << traced.status();
  return *std::move(traced);
}

// The line is much thinner than its distance from the wall: one integral along it.
TEST(Interreflection, OneReflectionInAGrooveIsTheIntegralAlongTheLine) {
  const SceneView view = GrooveView();
  const SubPixelGrid grid = Grid(12, 10, 0.3e-3);
  const LaserTransport traced = TraceLaser(Groove(), view, grid, Settings(512, 1));
  const double tangent = std::tan(view.laser_source.fan_angle_rad / 2);
  const double length = 2 * 0.3 * tangent;
  int on_wall = 0;
  for (int i = 0; i < grid.rows(); ++i) {
    for (int j = 0; j < grid.columns(); ++j) {
      if (traced.material.At(i, j) != 1) continue;
      const Eigen::Vector3d d = grid.U(j) / 0.02 * view.camera.x_axis +
                                grid.V(i) / 0.02 * view.camera.y_axis + view.camera.z_axis;
      const Eigen::Vector3d y = view.camera.origin_m + d * (-view.camera.origin_m.y() / d.y());
      if (y.z() < 0.004) continue;  // a pixel covers 5 mm: too coarse near the edge
      const int n = 2000;
      double irradiance = 0;
      for (int k = 0; k < n; ++k) {
        const Eigen::Vector3d x(((k + 0.5) / n - 0.5) * length, -0.01, 0);
        const Eigen::Vector3d to = x - y;
        const double r2 = to.squaredNorm(), r = std::sqrt(r2);
        irradiance += view.laser_source.power_w / n * kFloorAlbedo / std::numbers::pi *
                      (y.z() / r) * (0.01 / r) / r2;
      }
      const double expected = kWallAlbedo / std::numbers::pi * irradiance;
      // The pixel's mean differs from its centre by its curvature: 5 mm of a profile of 10 mm and
      // more; 3 %.
      EXPECT_NEAR(traced.indirect_radiance_w_m2_sr.At(i, j) / expected, 1, 0.04) << y.transpose();
      ++on_wall;
    }
  }
  EXPECT_GT(on_wall, 20);
}

// A wide line, so that plain paths meet it often enough.
TEST(Interreflection, AgreesWithBruteForceUpToFiveReflections) {
  SceneView view = GrooveView();
  view.laser_source.divergence_rad = 5e-3;  // w = 3 mm
  const SubPixelGrid grid = Grid(16, 12, 0.25e-3);
  auto rays = RayScene::Make(Groove());
  ASSERT_TRUE(rays.ok());
  for (const int bounces : {1, 2, 4}) {
    PlainSettings plain;
    plain.samples_per_px = 4096;
    plain.max_bounces = bounces;
    const PlainImage expected = PlainPathTracer(**rays).TraceLaserIndirect(view, grid, plain);
    const LaserTransport traced = TraceLaser(Groove(), view, grid, Settings(256, bounces));
    double sum = 0, reference = 0, variance = 0;
    for (size_t p = 0; p < expected.mean.values.size(); ++p) {
      sum += traced.indirect_radiance_w_m2_sr.values[p];
      reference += expected.mean.values[p];
      variance += std::pow(expected.standard_error.values[p], 2);
    }
    // Our own error is small beside the plain tracer's.
    EXPECT_LT(std::abs(sum - reference), 4 * std::sqrt(variance) + 2e-3 * reference)
        << bounces << ": " << sum << " " << reference;
    EXPECT_LT(std::sqrt(variance), 0.01 * reference);
  }
}

// Light gets into the box only through a slit and reaches the camera after two reflections or more:
// the line itself cannot be seen from what the camera sees.
TEST(Interreflection, LightAroundACornerAgreesWithBruteForce) {
  SceneDescription scene;
  const auto add = [&](const TriangleMesh& mesh) { scene.meshes.push_back({mesh, {}}); };
  add(Rectangle({0, 0, 0}, {0.05, 0, 0}, {0, 0.1, 0}));        // floor
  add(Rectangle({0, 0, 0.06}, {0.05, 0, 0}, {0, -0.04, 0}));   // lid
  add(Rectangle({0, 0.1, 0.03}, {0.05, 0, 0}, {0, 0, 0.03}));  // end walls
  add(Rectangle({0, -0.1, 0.03}, {0.05, 0, 0}, {0, 0, -0.03}));
  add(Rectangle({0, 0.03, 0.045}, {0.05, 0, 0}, {0, 0, 0.015}));  // screen: a slit is left below
  scene.materials = {TestLambert(0.8)};
  SceneView view;
  view.camera = Look({0, -0.15, 0.3}, {0, 0.09, -0.3}, {1, 0, 0});
  view.image_distance_m = 0.02;
  view.laser = Look({0, 0.07, 0.3}, {0, 0, -1}, {1, 0, 0});
  view.laser_source.fan_angle_rad = 10 * std::numbers::pi / 180;
  view.laser_source.divergence_rad = 15e-3;
  const SubPixelGrid grid = Grid(10, 6, 0.2e-3);
  auto rays = RayScene::Make(scene);
  ASSERT_TRUE(rays.ok());
  PlainSettings plain;
  plain.samples_per_px = 16384;
  plain.max_bounces = 4;
  const PlainImage expected = PlainPathTracer(**rays).TraceLaserIndirect(view, grid, plain);
  const LaserTransport traced = TraceLaser(scene, view, grid, Settings(1024, 4));
  double sum = 0, reference = 0, variance = 0;
  for (size_t p = 0; p < expected.mean.values.size(); ++p) {
    sum += traced.indirect_radiance_w_m2_sr.values[p];
    reference += expected.mean.values[p];
    variance += std::pow(expected.standard_error.values[p], 2);
  }
  ASSERT_GT(reference, 0);
  EXPECT_LT(std::abs(sum - reference), 4 * std::sqrt(variance) + 0.01 * reference)
      << sum << " " << reference;
  EXPECT_LT(std::sqrt(variance), 0.03 * reference);
}

TEST(Interreflection, OffMeansDirectLightOnly) {
  TransportSettings settings = Settings(16, 4);
  settings.laser_interreflection = false;
  const SubPixelGrid grid = Grid(16, 12, 0.25e-3, 2);
  const LaserTransport direct = TraceLaser(Groove(), GrooveView(), grid, settings);
  for (const float v : direct.indirect_radiance_w_m2_sr.values) EXPECT_EQ(v, 0);
  settings.laser_interreflection = true;
  const LaserTransport both = TraceLaser(Groove(), GrooveView(), grid, settings);
  for (size_t p = 0; p < both.radiance_w_m2_sr.values.size(); ++p) {
    EXPECT_FLOAT_EQ(both.radiance_w_m2_sr.values[p] - both.indirect_radiance_w_m2_sr.values[p],
                    direct.radiance_w_m2_sr.values[p]);
  }
}

}  // namespace
}  // namespace sightline
