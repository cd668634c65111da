// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "render_worker/light_transport/light_transport.h"
#include "tests/render_worker/light_transport/test_scenes.h"

namespace sightline {
namespace {

constexpr double kAlbedo = 0.5;
constexpr double kDistance_m = 0.3, kImageDistance_m = 0.017, kLaserDistance_m = 0.36;

// The plate z = 0 seen from above; the laser's sheet contains the x axis and comes in at 45
// degrees.
struct PlateScene {
  SceneDescription scene;
  SceneView view;

  PlateScene() {
    SceneMesh plate;
    plate.mesh = Rectangle({0, 0, 0}, {0.5, 0, 0}, {0, 0.5, 0});
    scene.meshes.push_back(plate);
    scene.materials = {TestLambert(kAlbedo)};
    view.camera = LookDown({0, 0, kDistance_m});
    view.image_distance_m = kImageDistance_m;
    const Eigen::Vector3d from =
        kLaserDistance_m * Eigen::Vector3d(0, -std::sqrt(0.5), std::sqrt(0.5));
    view.laser = Look(from, -from, {1, 0, 0});
    view.laser_source.fan_angle_rad = 40 * std::numbers::pi / 180;
  }

  double LineLength() const {
    return 2 * kLaserDistance_m * std::tan(view.laser_source.fan_angle_rad / 2);
  }

  LaserTransport Trace(const SubPixelGrid& grid) const {
    auto transport = LightTransport::Make(scene);
    EXPECT_TRUE(transport.ok()) << transport.status();
    TransportSettings settings;
    settings.laser_interreflection = false;
    settings.threads = 1;
    auto traced = (*transport)->TraceLaser(view, grid, settings, {});
    EXPECT_TRUE(traced.ok()) << traced.status();
    return *std::move(traced);
  }
};

TEST(DirectLaser, PlateHasTheRadianceOfTheRecordingsModel) {
  const PlateScene scene;
  const SubPixelGrid grid = Grid(80, 64, 2e-6);  // footprint 35 um, w = 0.15 mm
  const LaserTransport traced = scene.Trace(grid);
  const Laser& laser = scene.view.laser_source;
  const double w0 = laser.wavelength_m / (std::numbers::pi * laser.divergence_rad);
  const double w =
      std::hypot(w0, laser.divergence_rad * (kLaserDistance_m - laser.beam_focus_distance_m));
  const double cosine = std::cos(std::numbers::pi / 4);
  const double largest =
      2 * laser.power_w / (std::sqrt(2 * std::numbers::pi) * w * scene.LineLength());
  const double pitch = grid.pixel_pitch_m * kDistance_m / kImageDistance_m;
  double worst = 0;
  for (int i = 0; i < grid.rows(); ++i) {
    const double s = grid.V(i) * kDistance_m / kImageDistance_m;
    // Mean over the sub-pixel by Simpson's rule.
    const auto profile = [&](double at) {
      const double x = at * cosine;
      return largest * std::exp(-2 * x * x / (w * w)) * cosine;
    };
    const double mean = (profile(s - pitch / 2) + 4 * profile(s) + profile(s + pitch / 2)) / 6;
    for (int j = 0; j < grid.columns(); ++j) {
      const double expected = kAlbedo / std::numbers::pi * mean;
      worst = std::max(worst, std::abs(traced.radiance_w_m2_sr.At(i, j) - expected));
      EXPECT_NEAR(traced.depth_m.At(i, j), kDistance_m, 1e-6);
    }
  }
  // w changes along the tilted sheet by divergence * 1 mm / w = 0.2 % at the edge of the image,
  // Simpson's rule is exact to 1e-4 here.
  EXPECT_LT(worst, 3e-3 * kAlbedo / std::numbers::pi * largest);
}

TEST(DirectLaser, ALineThinnerThanASubPixelKeepsItsPower) {
  PlateScene scene;
  // Waist of 3 um on the plate; sub-pixels cover 0.7 mm.
  scene.view.laser_source.wavelength_m = 1e-9;
  scene.view.laser_source.divergence_rad = 1e-4;
  scene.view.laser_source.beam_focus_distance_m = kLaserDistance_m;
  for (const double shift_px : {0.0, 0.23, 0.5}) {
    SubPixelGrid grid = Grid(9, 15, 40e-6);
    const double pitch = grid.pixel_pitch_m * kDistance_m / kImageDistance_m;
    PlateScene shifted = scene;
    shifted.view.camera.origin_m.y() += shift_px * pitch;
    const LaserTransport traced = shifted.Trace(grid);
    for (int j = 0; j < grid.columns(); ++j) {
      double power_per_length = 0;
      for (int i = 0; i < grid.rows(); ++i) {
        power_per_length += traced.radiance_w_m2_sr.At(i, j) * pitch;
      }
      power_per_length *= std::numbers::pi / kAlbedo;
      const double expected = shifted.view.laser_source.power_w / shifted.LineLength();
      EXPECT_NEAR(power_per_length / expected, 1, 1e-3) << shift_px;
    }
  }
}

TEST(DirectLaser, TotalPowerOfTheLineArrives) {
  PlateScene scene;
  scene.view.laser_source.fan_angle_rad = 20 * std::numbers::pi / 180;
  for (const LineProfile profile : {LineProfile::kPowell, LineProfile::kGaussian}) {
    scene.view.laser_source.line_profile = profile;
    const SubPixelGrid grid = Grid(1200, 24, 10e-6);  // 0.21 m along the line
    const LaserTransport traced = scene.Trace(grid);
    const double pitch = grid.pixel_pitch_m * kDistance_m / kImageDistance_m;
    double power = 0;
    for (const float radiance : traced.radiance_w_m2_sr.values) {
      power += radiance * std::numbers::pi / kAlbedo * pitch * pitch;
    }
    // The Gaussian line beyond 0.21 m: 0.1 % of the power; ends of the Powell line: 1/700.
    EXPECT_NEAR(power / scene.view.laser_source.power_w, 1, 3e-3);
  }
}

TEST(DirectLaser, SomethingInTheFanShadowsThePlate) {
  PlateScene scene;
  // Blocks tan(phi) in (0.05, 0.1) half way to the plate.
  const SensorPose& laser = scene.view.laser;
  const Eigen::Vector3d centre = laser.origin_m + 0.1 * (laser.z_axis + 0.075 * laser.x_axis);
  SceneMesh block;
  block.mesh = Rectangle(centre, 0.1 * 0.025 * laser.x_axis, 0.02 * laser.y_axis);
  scene.scene.meshes.push_back(block);
  const SubPixelGrid grid = Grid(201, 1, 20e-6);
  const LaserTransport traced = scene.Trace(grid);
  int dark = 0;
  for (int j = 0; j < grid.columns(); ++j) {
    const double t = grid.U(j) / kImageDistance_m * kDistance_m / kLaserDistance_m;
    const double edge = std::min(std::abs(t - 0.05), std::abs(t - 0.1));
    if (edge < 2e-3) continue;
    const bool shadow = t > 0.05 && t < 0.1;
    EXPECT_EQ(traced.radiance_w_m2_sr.At(0, j) == 0, shadow) << t;
    dark += shadow ? 1 : 0;
  }
  EXPECT_GT(dark, 20);
}

}  // namespace
}  // namespace sightline
