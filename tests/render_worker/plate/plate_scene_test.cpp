// SPDX-License-Identifier: Apache-2.0
#include "render_worker/plate/plate_scene.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

using std::numbers::pi;

FrameSetup Frame() {
  FrameSetup frame;
  frame.lens.focal_length_m = 0.016;
  frame.lens.f_number = 8;
  frame.lens.focus_distance_m = 0.331;
  frame.lens.transmission = 0.92;
  frame.laser.power_w = 0.58e-3;
  frame.laser.divergence_rad = 1.05e-3;
  frame.laser.beam_focus_distance_m = 0.44;
  frame.laser.fan_angle_rad = 36.8 * pi / 180;
  frame.plate = {0.331, 0.416, pi / 4, 0};
  frame.roi = {-192, -128, 384, 256};
  frame.sensor.quantum_efficiency[0] = {{661e-9}, {0.53}};
  return frame;
}

TEST(PlateScene, PowerAcrossTheLineIsPowerOverLength) {
  for (const double laser_distance : {0.28, 0.44, 0.7}) {
    for (const double incidence : {0.1, 0.8, 1.2}) {
      FrameSetup frame = Frame();
      frame.plate.laser_distance_m = laser_distance;
      frame.plate.incidence_angle_rad = incidence;
      frame.plate.line_offset_m = 0.011;
      const PlateScene scene = MakePlateScene(frame);
      const double reach = 8 * BeamRadius(frame.laser, laser_distance) / std::cos(incidence);
      double sum = 0;
      constexpr int kSteps = 4000;  // trapezium rule on a Gaussian: exact to rounding
      for (int i = 0; i <= kSteps; ++i) {
        sum += scene.laser_irradiance_w_m2(0.1, 0.011 + reach * (2.0 * i / kSteps - 1));
      }
      const double length = 2 * laser_distance * std::tan(frame.laser.fan_angle_rad / 2);
      EXPECT_NEAR(sum * 2 * reach / kSteps / (frame.laser.power_w / length), 1, 1e-9);
    }
  }
}

TEST(PlateScene, BeamHasItsWaistAndItsFarFieldAngle) {
  Laser laser = Frame().laser;
  const double waist = laser.wavelength_m / (pi * laser.divergence_rad);
  EXPECT_NEAR(BeamRadius(laser, laser.beam_focus_distance_m) / waist, 1, 1e-12);
  // w(z) = w0 sqrt(1 + (z lambda / (pi w0^2))^2).
  const double z = 0.1;
  const double expected =
      waist * std::sqrt(1 + std::pow(z * laser.wavelength_m / (pi * waist * waist), 2));
  EXPECT_NEAR(BeamRadius(laser, laser.beam_focus_distance_m - z) / expected, 1, 1e-12);
  laser.beam_quality_m2 = 3;
  EXPECT_NEAR(BeamRadius(laser, laser.beam_focus_distance_m) / waist, 3, 1e-12);
  EXPECT_NEAR(BeamRadius(laser, 1e3) / 1e3, laser.divergence_rad, 1e-6);
}

// Walter et al., Microfacet models for refraction, EGSR 2007, eq. 20, 33, 34, with vectors.
double GgxByVectors(const PlateSurface& surface, double incidence) {
  const Eigen::Vector3d normal(0, 0, 1);
  const Eigen::Vector3d view(0, 0, 1);
  const Eigen::Vector3d light(std::sin(incidence), 0, std::cos(incidence));
  const Eigen::Vector3d half = (view + light).normalized();
  const double alpha2 = surface.ggx_alpha * surface.ggx_alpha;
  const double tan_half = half.head<2>().norm() / half.z();
  const double distribution =
      alpha2 / (pi * std::pow(half.z(), 4) * std::pow(alpha2 + tan_half * tan_half, 2));
  const auto masking = [&](const Eigen::Vector3d& direction) {
    const double slope = direction.head<2>().norm() / direction.z();
    const double lambda = (-1 + std::sqrt(1 + alpha2 * slope * slope)) / 2;
    return 1 / (1 + lambda);
  };
  const double fresnel =
      surface.specular_f0 + (1 - surface.specular_f0) * std::pow(1 - half.dot(light), 5);
  return surface.diffuse_albedo / pi + distribution * fresnel * masking(light) * masking(view) /
                                           (4 * normal.dot(light) * normal.dot(view));
}

TEST(PlateScene, BrdfIsThatOfTheMicrofacetModel) {
  for (const double alpha : {0.1, 0.43, 0.9}) {
    for (const double incidence : {0.01, 0.5, 0.7854, 1.2}) {
      const PlateSurface surface = {0.35, 0.66, alpha};
      EXPECT_NEAR(PlateBrdf(surface, incidence) / GgxByVectors(surface, incidence), 1, 1e-12);
    }
  }
}

TEST(PlateScene, LineLiesAtMagnificationTimesOffset) {
  for (const double camera_distance : {0.25, 0.331, 0.5}) {
    FrameSetup frame = Frame();
    frame.plate.camera_distance_m = camera_distance;  // out of focus but once
    const double b = 1 / (1 / 0.016 - 1 / 0.331);
    frame.plate.line_offset_m = 37.4 * frame.sensor.pixel_pitch_m * camera_distance / b;
    const IdealImage image =
        RenderPlate(MakePlateScene(frame), frame, {frame.roi, 2, 3, frame.sensor.pixel_pitch_m});
    double sum = 0, moment = 0;
    for (int i = 0; i < image.grid.rows(); ++i) {
      const double value = image.laser_irradiance_w_m2.At(i, 100);
      sum += value;
      moment += value * image.grid.V(i) / frame.sensor.pixel_pitch_m;
    }
    // cos^4 over the line's width pulls the centre by far less.
    EXPECT_NEAR(moment / sum, 37.4, 2e-3) << camera_distance;
  }
}

TEST(PlateScene, IrradianceIsThePupilsSolidAngle) {
  // E = L times the integral over the pupil of cos^2 / r^2, by quadrature, at f/16 and off axis.
  FrameSetup frame = Frame();
  frame.lens.f_number = 16;
  frame.roi = {600, -4, 8, 8};
  PlateScene scene;
  scene.laser_irradiance_w_m2 = [](double, double) { return 3.0; };
  scene.brdf_per_sr = [](double, double) { return 0.25; };
  const IdealImage image = RenderPlate(scene, frame, {frame.roi, 2, 0, frame.sensor.pixel_pitch_m});
  const double u = image.grid.U(5), v = image.grid.V(9);
  const double b = frame.ImageDistance();
  const double radius = frame.PupilDiameter() / 2;
  double sum = 0;
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i) {
    const double r = radius * std::sqrt((i + 0.5) / kSteps);
    for (int j = 0; j < 60; ++j) {
      const double phi = 2 * pi * j / 60;
      const double square =
          b * b + std::pow(r * std::cos(phi) - u, 2) + std::pow(r * std::sin(phi) - v, 2);
      sum += b * b / (square * square);
    }
  }
  const double expected =
      0.75 * frame.lens.transmission * sum * pi * radius * radius / (kSteps * 60);
  // The pupil's own extent: (R/b)^2 and (u R/b^2)^2.
  EXPECT_NEAR(image.laser_irradiance_w_m2.At(9, 5) / expected, 1, 2 * std::pow(radius / b, 2));
  EXPECT_TRUE(image.incoherent_electron_flux_m2_s[0].empty());
}

TEST(PlateScene, LightOfTheWholeLineInClosedForm) {
  const FrameSetup frame = Frame();
  const IdealImage image =
      RenderPlate(MakePlateScene(frame), frame, {frame.roi, 3, 0, frame.sensor.pixel_pitch_m});
  double sum = 0;
  const int column = 192 * 3 + 1;  // u = 0
  for (int i = 0; i < image.grid.rows(); ++i) sum += image.laser_irradiance_w_m2.At(i, column);
  const double b = frame.ImageDistance();
  const double length = 2 * 0.416 * std::tan(frame.laser.fan_angle_rad / 2);
  const double expected = pi / 4 * 0.92 * std::pow(frame.PupilDiameter() / b, 2) *
                          PlateBrdf(frame.surface, pi / 4) * frame.laser.power_w / length * b /
                          0.331;
  // cos^4 differs from 1 by 2 (v/b)^2 over the line: 1e-5.
  EXPECT_NEAR(sum * frame.sensor.pixel_pitch_m / 3 / expected, 1, 2e-5);
}

TEST(PlateScene, HeightMovesTheImageAndTheDepth) {
  const FrameSetup frame = Frame();
  PlateScene scene = MakePlateScene(frame);
  scene.constant_along_line = false;
  scene.height_m = [](double x_m, double) { return 0.1 * x_m; };
  scene.laser_irradiance_w_m2 = [](double x_m, double) { return x_m; };
  scene.brdf_per_sr = [](double, double) { return 1.0; };
  const IdealImage image = RenderPlate(scene, frame, {frame.roi, 2, 0, frame.sensor.pixel_pitch_m});
  // x = (d - h) u/b, h = 0.1 x: x = d u/b / (1 + 0.1 u/b).
  const int column = 700;
  const double slope = image.grid.U(column) / frame.ImageDistance();
  const double x = 0.331 * slope / (1 + 0.1 * slope);
  EXPECT_NEAR(image.depth_m.At(100, column), 0.331 - 0.1 * x, 1e-7);
  const double ratio = frame.PupilDiameter() / frame.ImageDistance();
  const double v = image.grid.V(100) / frame.ImageDistance();
  EXPECT_NEAR(image.laser_irradiance_w_m2.At(100, column) /
                  (x * pi / 4 * 0.92 * ratio * ratio / std::pow(1 + slope * slope + v * v, 2)),
              1, 1e-6);
}

TEST(PlateScene, PlacewiseAndColumnwiseRenderingAgree) {
  const FrameSetup frame = Frame();
  PlateScene scene = MakePlateScene(frame);
  const SubPixelGrid grid = {frame.roi, 3, 5, frame.sensor.pixel_pitch_m};
  const IdealImage by_column = RenderPlate(scene, frame, grid);
  scene.constant_along_line = false;
  const IdealImage by_place = RenderPlate(scene, frame, grid, 2);
  double peak = 0, error = 0;
  for (size_t i = 0; i < by_place.laser_irradiance_w_m2.values.size(); ++i) {
    const double value = by_column.laser_irradiance_w_m2.values[i];
    peak = std::max(peak, value);
    error = std::max(error, std::abs(value - by_place.laser_irradiance_w_m2.values[i]));
  }
  // Pixels are left out where no corner has a millionth of a millionth.
  EXPECT_LT(error, 1e-11 * peak);
}

TEST(PlateScene, AmbientLightReleasesItsElectrons) {
  const FrameSetup frame = Frame();
  PlateScene scene = MakePlateScene(frame);
  scene.ambient_radiance_w_m2_sr = [](double, double) { return 0.02; };
  const IdealImage image = RenderPlate(scene, frame, {frame.roi, 2, 0, frame.sensor.pixel_pitch_m});
  const SubPixelGrid& grid = image.incoherent_grid;
  const int row = 128 + grid.margin_px, column = 192 + grid.margin_px;  // the axis
  const double irradiance =
      pi / 4 * 0.92 * 0.02 * std::pow(frame.PupilDiameter() / frame.ImageDistance(), 2);
  EXPECT_NEAR(image.incoherent_irradiance_w_m2.At(row, column) / irradiance, 1, 1e-6);
  EXPECT_NEAR(image.incoherent_electron_flux_m2_s[0].At(row, column) /
                  (irradiance * 0.53 * 661e-9 / (6.62607015e-34 * 299792458)),
              1, 1e-6);
  EXPECT_TRUE(image.incoherent_electron_flux_m2_s[1].empty());
}

}  // namespace
}  // namespace sightline
