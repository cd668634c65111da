// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "render_worker/light_transport/light_transport.h"
#include "render_worker/light_transport/reference_path_tracer.h"
#include "render_worker/light_transport/scene.h"
#include "tests/render_worker/light_transport/test_scenes.h"

namespace sightline {
namespace {

Spectrum One() {
  Spectrum one;
  one.fill(1);
  return one;
}

IncoherentTransport TraceIncoherent(const SceneDescription& scene, const SceneView& view,
                                    const SubPixelGrid& grid, const TransportSettings& settings,
                                    const std::vector<Spectrum>& weights = {One()}) {
  auto transport = LightTransport::Make(scene);
  EXPECT_TRUE(transport.ok()) << transport.status();
  auto traced = (*transport)->TraceIncoherent(view, grid, weights, settings, {});
  EXPECT_TRUE(traced.ok()) << traced.status();
  return *std::move(traced);
}

TransportSettings Unfiltered(int samples) {
  TransportSettings settings;
  settings.filter = false;
  settings.first_samples_per_px = samples;
  settings.max_samples_per_px = samples;
  settings.threads = 1;
  return settings;
}

// Lower half of a sphere of radius 1, open at z = 0.
TriangleMesh Bowl() {
  TriangleMesh mesh;
  const int rings = 48, sectors = 96;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const double polar = std::numbers::pi / 2 * i / rings;
      const double azimuth = 2 * std::numbers::pi * j / sectors;
      mesh.positions_m.emplace_back(static_cast<float>(std::cos(polar) * std::cos(azimuth)),
                                    static_cast<float>(std::cos(polar) * std::sin(azimuth)),
                                    static_cast<float>(-std::sin(polar)));
    }
  }
  for (int i = 0; i < rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const auto at = [&](int a, int b) {
        return static_cast<uint32_t>(a * sectors + b % sectors);
      };
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

// Between any two elements of a sphere the form factor is dA/(4 pi R^2): every point of the bowl
// sees the opening with weight 1/2 and the bowl evenly with 1/2.
TEST(Incoherent, BowlUnderAmbientIsAGeometricSeries) {
  SceneDescription scene;
  scene.meshes.push_back({Bowl(), {}});
  scene.ambient_radiance_w_m2_sr = EvenSpectrum(2);
  SceneView view;
  view.camera = LookDown({0, 0, 3});
  view.image_distance_m = 0.02;
  const SubPixelGrid grid = Grid(4, 4, 0.5e-3);
  for (const double albedo : {0.3, 1.0}) {
    scene.materials = {TestLambert(albedo)};
    for (const int bounces : {0, 1, 4, 30}) {
      TransportSettings settings = Unfiltered(16384);
      settings.max_bounces = bounces;
      const IncoherentTransport traced = TraceIncoherent(scene, view, grid, settings);
      double expected = 0;
      for (int k = 0; k <= bounces; ++k) expected += albedo * std::pow(albedo / 2, k) * 2 / 2;
      double mean = 0;
      for (const float v : traced.radiance_w_m2_sr.values) mean += v / 16.0;
      // 262144 samples of a value that is 0 or 2: standard error at most 0.0017
      // with independent points and four bounces; low-discrepancy points do better. The
      // polyhedron's opening is 0.1 % smaller than the sphere's.
      EXPECT_NEAR(mean, expected, 4e-3) << albedo << " " << bounces;
    }
  }
}

TEST(Incoherent, PlateUnderALampHasTheClosedFormIrradiance) {
  const double a = 0.1, b = 0.15, h = 0.2, albedo = 0.6, radiance = 5;
  SceneDescription scene;
  scene.meshes.push_back({Rectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), {}});
  scene.materials = {TestLambert(albedo)};
  scene.area_lights = {{{0, 0, h}, {a, 0, 0}, {0, -b, 0}, EvenSpectrum(radiance)}};
  SceneView view;
  view.camera = Look({0.3, 0, 0.1}, {-0.3, 0, -0.1}, {0, 1, 0});
  view.image_distance_m = 0.02;
  const SubPixelGrid grid = Grid(8, 8, 1e-7);
  const IncoherentTransport traced = TraceIncoherent(scene, view, grid, Unfiltered(1024));
  // Four corner rectangles (Howell, configuration factor B-4).
  const double ra = std::hypot(a, h), rb = std::hypot(b, h);
  const double irradiance =
      radiance * 2 * (a / ra * std::atan(b / ra) + b / rb * std::atan(a / rb));
  const double expected = albedo / std::numbers::pi * irradiance;
  double mean = 0, squares = 0, stated = 0;
  for (size_t p = 0; p < 64; ++p) {
    const double v = traced.radiance_w_m2_sr.values[p];
    mean += v / 64;
    squares += std::pow(v - expected, 2) / 64;
    stated += std::pow(traced.standard_error_w_m2_sr.values[p], 2) / 64;
  }
  EXPECT_NEAR(mean / expected, 1, 1e-3);
  // Mean square error of 64 pixels against the stated one: relative deviation sqrt(2/64) = 0.18.
  EXPECT_LT(squares, stated * (1 + 5 * 0.18));
  EXPECT_GT(squares, stated * (1 - 5 * 0.18));
}

TEST(Incoherent, ColouredSurfacesReflectBinByBin) {
  SceneDescription scene;
  scene.meshes.push_back({Rectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), {}});
  scene.materials = {TestColouredLambert(0.8)};
  scene.ambient_radiance_w_m2_sr = EvenSpectrum(47);
  SceneView view;
  view.camera = LookDown({0, 0, 0.3});
  view.image_distance_m = 0.02;
  Spectrum low = {}, high = {};
  low[4] = 1;
  high[40] = 2;
  const IncoherentTransport traced =
      TraceIncoherent(scene, view, Grid(2, 2, 1e-6), Unfiltered(64), {low, high});
  // A flat plate under an even sky: every sample is exact.
  EXPECT_NEAR(traced.channel_radiance[0].At(0, 0), 0.8 * 5 / 47, 1e-5);
  EXPECT_NEAR(traced.channel_radiance[1].At(1, 1), 2 * 0.8 * 41 / 47, 1e-5);
}

TEST(Incoherent, EdgeOutOfFocusBlursByTheCircleOfConfusion) {
  // The edge x = 0 of a lamp that faces the camera.
  SceneDescription scene;
  scene.meshes.push_back({Rectangle({0, 0, -5}, {0.01, 0, 0}, {0, 0.01, 0}), {}});
  scene.materials = {TestLambert(0)};
  scene.area_lights = {{{0.5, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0}, EvenSpectrum(1)}};
  SceneView view;
  const double z = 0.4;
  view.camera = LookDown({0, 0, z});
  view.image_distance_m = 0.017;
  view.focus_distance_m = 0.3;
  view.pupil_radius_m = 2e-3;
  const SubPixelGrid grid = Grid(80, 1, 1e-6);
  const IncoherentTransport traced = TraceIncoherent(scene, view, grid, Unfiltered(1024));
  const double blur = 2 * view.pupil_radius_m * view.image_distance_m * std::abs(1 / 0.3 - 1 / z);
  EXPECT_NEAR(blur, 56.7e-6, 1e-7);
  double mean = 0, square = 0;
  for (int j = 1; j < grid.columns(); ++j) {
    const double u = (grid.U(j) + grid.U(j - 1)) / 2;
    const double weight = traced.radiance_w_m2_sr.At(0, j) - traced.radiance_w_m2_sr.At(0, j - 1);
    mean += weight * u;
    square += weight * u * u;
    if (std::abs(u) > blur / 2 + 1e-6) {
      EXPECT_NEAR(weight, 0, 1e-6);
    }
  }
  EXPECT_NEAR(traced.radiance_w_m2_sr.At(0, 79) - traced.radiance_w_m2_sr.At(0, 0), 1, 1e-6);
  EXPECT_NEAR(mean, 0, 0.2e-6);
  // Even disc of diameter c seen edge on: variance c^2/16, and the pixel's p^2/12.
  EXPECT_NEAR(square, blur * blur / 16 + 1e-12 / 12, 0.02 * blur * blur / 16);
}

// A floor with a wall and a block under a lamp and ambient.
SceneDescription Corner() {
  SceneDescription scene;
  SceneMesh mesh;
  mesh.mesh = Rectangle({0, 0, 0}, {0.2, 0, 0}, {0, 0.2, 0});
  scene.meshes.push_back(mesh);
  mesh.mesh = Rectangle({0, 0.1, 0.1}, {0.2, 0, 0}, {0, 0, 0.1});
  mesh.triangle_material = {1, 1};
  scene.meshes.push_back(mesh);
  mesh.mesh = Rectangle({0.02, 0, 0.03}, {0.03, 0, 0}, {0, 0.03, 0});
  scene.meshes.push_back(mesh);
  scene.materials = {TestLambert(0.7), TestLambert(0.4)};
  scene.area_lights = {{{0.1, -0.1, 0.3}, {0.05, 0, 0}, {0, -0.05, 0}, EvenSpectrum(30)}};
  scene.ambient_radiance_w_m2_sr = EvenSpectrum(1);
  return scene;
}

SceneView CornerView() {
  SceneView view;
  view.camera = Look({0, -0.25, 0.3}, {0, 0.25, -0.3}, {1, 0, 0});
  view.image_distance_m = 0.02;
  view.focus_distance_m = 0.38;
  view.pupil_radius_m = 1e-3;
  return view;
}

TEST(Incoherent, AgreesWithThePlainPathTracer) {
  const SubPixelGrid grid = Grid(24, 20, 0.4e-3);
  auto rays = RayScene::Make(Corner());
  ASSERT_TRUE(rays.ok());
  PlainSettings plain;
  plain.samples_per_px = 1500;
  const PlainImage expected =
      PlainPathTracer(**rays).TraceIncoherent(CornerView(), grid, One(), plain);
  const IncoherentTransport traced = TraceIncoherent(Corner(), CornerView(), grid, Unfiltered(512));
  double chi2 = 0, difference = 0, variance = 0;
  int n = 0;
  for (size_t p = 0; p < expected.mean.values.size(); ++p) {
    const double d = traced.radiance_w_m2_sr.values[p] - expected.mean.values[p];
    const double v = std::pow(expected.standard_error.values[p], 2) +
                     std::pow(traced.standard_error_w_m2_sr.values[p], 2);
    if (v <= 0) continue;
    chi2 += d * d / v;
    difference += d;
    variance += v;
    ++n;
  }
  ASSERT_GT(n, 400);
  EXPECT_LT(std::abs(difference), 4 * std::sqrt(variance));
  // chi^2/n has standard deviation sqrt(2/n) = 0.065.
  EXPECT_LT(chi2 / n, 1 + 5 * std::sqrt(2.0 / n));
  EXPECT_GT(chi2 / n, 0.7);
}

TEST(Incoherent, FilteredImageStaysWithinItsStatedError) {
  const SubPixelGrid grid = Grid(40, 32, 0.05e-3);
  TransportSettings settings = Unfiltered(512);
  const IncoherentTransport reference = TraceIncoherent(Corner(), CornerView(), grid, settings);
  settings.filter = true;
  settings.first_samples_per_px = 16;
  settings.max_samples_per_px = 64;
  settings.seed = 5;
  const IncoherentTransport filtered = TraceIncoherent(Corner(), CornerView(), grid, settings);
  settings.filter = false;
  settings.max_samples_per_px = 16;
  const IncoherentTransport noisy = TraceIncoherent(Corner(), CornerView(), grid, settings);
  double error = 0, noise = 0, stated = 0;
  for (size_t p = 0; p < reference.radiance_w_m2_sr.values.size(); ++p) {
    const double expected = reference.radiance_w_m2_sr.values[p];
    error += std::pow(filtered.radiance_w_m2_sr.values[p] - expected, 2);
    noise += std::pow(noisy.radiance_w_m2_sr.values[p] - expected, 2);
    stated += std::pow(filtered.standard_error_w_m2_sr.values[p], 2) +
              std::pow(reference.standard_error_w_m2_sr.values[p], 2);
  }
  EXPECT_LT(error, 0.3 * noise);
  // Neighbours share noise, so the mean square error itself is uncertain; twice the stated error is
  // out of reach of that.
  EXPECT_LT(error, 4 * stated);
}

}  // namespace
}  // namespace sightline
