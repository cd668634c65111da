// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/lamps/lamp_sampling.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "tests/render_worker/light_transport/test_scenes.h"

namespace sightline {
namespace {

EmittingRectangle Lamp() {
  return {{0.1, -0.05, 0.4}, {0.15, 0, 0}, {0, -0.1, 0}, EvenSpectrum(1)};
}

TEST(SphericalRectangle, SolidAngleIsTheIntegralOverTheArea) {
  const EmittingRectangle lamp = Lamp();
  const Eigen::Vector3d from(0.02, 0.03, 0.1);
  const int n = 400;
  double expected = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const Eigen::Vector3d to = lamp.centre_m + (2 * (i + 0.5) / n - 1) * lamp.half_edge_u_m +
                                 (2 * (j + 0.5) / n - 1) * lamp.half_edge_v_m - from;
      expected += 4 * lamp.half_edge_u_m.norm() * lamp.half_edge_v_m.norm() / (n * n) *
                  std::abs(to.z()) / std::pow(to.norm(), 3);
    }
  }
  EXPECT_NEAR(SphericalRectangle(lamp, from).solid_angle_sr() / expected, 1, 1e-5);
}

TEST(SphericalRectangle, DirectionsFillTheSolidAngleEvenly) {
  // The mean of 1/(density per area) over samples is the area: density = cos / (r^2 Omega).
  const EmittingRectangle lamp = Lamp();
  const Eigen::Vector3d from(0.02, 0.03, 0.1);
  const SphericalRectangle rectangle(lamp, from);
  const int n = 200;
  double area = 0;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      const Eigen::Vector3d p = rectangle.Sample((i + 0.5) / n, (j + 0.5) / n);
      const Eigen::Vector3d in_plane = p - lamp.centre_m;
      ASSERT_LE(std::abs(in_plane.x()), 0.15 + 1e-9);
      ASSERT_LE(std::abs(in_plane.y()), 0.1 + 1e-9);
      ASSERT_NEAR(p.z(), 0.4, 1e-9);
      const Eigen::Vector3d to = p - from;
      area += std::pow(to.norm(), 3) / std::abs(to.z()) * rectangle.solid_angle_sr() / (n * n);
    }
  }
  EXPECT_NEAR(area / (4 * 0.15 * 0.1), 1, 1e-4);
}

TEST(LampChoice, DensityOfASampleIsWhatPdfSays) {
  SceneDescription scene;
  scene.area_lights = {Lamp(), Lamp(), Lamp()};
  scene.area_lights[1].centre_m = {-0.3, 0.2, 0.3};
  scene.area_lights[2].centre_m = {0, 0, -0.4};  // below the surface
  const LampChoice choice(scene);
  SurfacePoint point;
  float total = 0;
  for (int k = 0; k < 64; ++k) {
    const auto s = choice.SampleLamp(point, (k + 0.5F) / 64, 0.3F, 0.7F);
    ASSERT_TRUE(s.lamp == 0 || s.lamp == 1);
    EXPECT_FLOAT_EQ(s.pdf, choice.Pdf(point, s.lamp));
  }
  for (int l = 0; l < 2; ++l) {
    const SphericalRectangle r(scene.area_lights[l], Eigen::Vector3d::Zero());
    total += choice.Pdf(point, l) * static_cast<float>(r.solid_angle_sr());
  }
  EXPECT_NEAR(total, 1, 1e-5);
  EXPECT_EQ(choice.Pdf(point, 2), 0);
}

}  // namespace
}  // namespace sightline
