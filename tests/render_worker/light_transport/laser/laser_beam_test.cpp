// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/laser/laser_beam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/render_worker/light_transport/test_scenes.h"

namespace sightline {
namespace {

Laser TestLaser() {
  Laser laser;
  laser.fan_angle_rad = 60 * std::numbers::pi / 180;
  laser.divergence_rad = 0.27e-3;
  return laser;
}

// Recordings format, section 3.
TEST(LaserBeam, ReproducesTheUniformLineOfEquation54) {
  const Laser laser = TestLaser();
  const LaserBeam beam(laser, Look({0, 0, 0}, {0, 0, 1}, {1, 0, 0}));
  const double d = 0.36, w0 = laser.wavelength_m / (std::numbers::pi * laser.divergence_rad);
  const double w = std::sqrt(w0 * w0 + std::pow(laser.divergence_rad * (d - 0.9), 2));
  EXPECT_NEAR(beam.Radius_m(d), w, 1e-12);
  const double length = 2 * d * std::tan(laser.fan_angle_rad / 2);
  const double largest = 2 * laser.power_w / (std::sqrt(2 * std::numbers::pi) * w * length);
  for (const double x : {0.0, 0.1, -0.2}) {
    for (const double q : {0.0, 0.7 * w}) {
      const auto c = beam.CoordinatesOf({x, q, d});
      const double on_plate =
          beam.Irradiance_w_m2(c) * beam.Direction(c).dot(Eigen::Vector3d::UnitZ());
      EXPECT_NEAR(on_plate / (largest * std::exp(-2 * q * q / (w * w))), 1, 1e-12);
    }
  }
}

TEST(LaserBeam, PowerThroughAnyPlaneIsTheLasers) {
  for (const LineProfile profile : {LineProfile::kPowell, LineProfile::kGaussian}) {
    Laser laser = TestLaser();
    laser.line_profile = profile;
    const LaserBeam beam(laser, Look({0, 0, 0}, {0, 0, 1}, {1, 0, 0}));
    // A plane tilted about the line's normal: z = 0.4 + x/2. Midpoint rule over x and q.
    const int n = 4000, m = 200;
    double power = 0;
    const double x0 = -1.6, x1 = 1.6;
    for (int i = 0; i < n; ++i) {
      const double x = x0 + (i + 0.5) / n * (x1 - x0), z = 0.4 + x / 2;
      if (z <= 0) continue;
      for (int k = 0; k < m; ++k) {
        const double q = ((k + 0.5) / m * 6 - 3) * beam.Radius_m(z);
        const auto c = beam.CoordinatesOf({x, q, z});
        if (!beam.Reaches(c, 3)) continue;
        const double cosine = beam.Direction(c).dot(Eigen::Vector3d(-0.5, 0, 1).normalized());
        const double area = (x1 - x0) / n * std::sqrt(1.25) * 6 * beam.Radius_m(z) / m;
        power += beam.Irradiance_w_m2(c) * cosine * area;
      }
    }
    // Ends of the fan fall within a step; the Gaussian line is left out beyond 5 sigma.
    EXPECT_NEAR(power / laser.power_w, 1, 2e-3);
  }
}

TEST(LaserBeam, MeanOverAFootprintIsTheIntegral) {
  const LaserBeam beam(TestLaser(), Look({0, 0, 0}, {0, 0, 1}, {1, 0, 0}));
  const double z = 0.4, w = beam.Radius_m(z);
  for (const double a : {1e-6, 1e-2, 0.3, 2.0, 40.0}) {
    for (const double b : {0.0, 1e-4, 1e-2, 0.5, 30.0}) {
      for (const double q : {0.0, 0.4, 1.5}) {
        const int n = 800;
        double mean = 0;
        for (int i = 0; i < n; ++i) {
          for (int k = 0; k < n; ++k) {
            const double at = q + a * ((i + 0.5) / n - 0.5) - b * ((k + 0.5) / n - 0.5);
            mean += std::exp(-2 * at * at) / (n * n);
          }
        }
        const double expected = beam.Irradiance_w_m2({0, 0, z}) * mean;
        // Midpoint rule: relative error (step)^2/24 f''/f, below 1e-3 for the coarsest step.
        EXPECT_NEAR(beam.MeanIrradiance_w_m2({0, q * w, z}, a * w, -b * w), expected,
                    1e-3 * expected + 1e-6)
            << a << " " << b << " " << q;
      }
    }
  }
}

TEST(LaserBeam, SamplesOfTheFanFollowThePower) {
  for (const LineProfile profile : {LineProfile::kPowell, LineProfile::kGaussian}) {
    Laser laser = TestLaser();
    laser.line_profile = profile;
    const LaserBeam beam(laser, Look({0, 0, 0}, {0, 0, 1}, {1, 0, 0}));
    const double tangent = std::tan(laser.fan_angle_rad / 2);
    double square = 0;
    const int n = 20000;
    for (int i = 0; i < n; ++i) square += std::pow(beam.SampleT((i + 0.5) / n) / tangent, 2) / n;
    EXPECT_NEAR(square, profile == LineProfile::kPowell ? 1.0 / 3 : 0.25, 1e-3);
  }
}

}  // namespace
}  // namespace sightline
