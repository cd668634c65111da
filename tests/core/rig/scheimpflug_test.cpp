// SPDX-License-Identifier: Apache-2.0
#include "core/rig/scheimpflug.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace sightline {
namespace {

// Every point of the object plane has its sharp image, by the thin lens's own law, on the sensor
// plane.
TEST(Scheimpflug, ImagesOfThePlaneLieOnTheSensor) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1, 1);
  constexpr double kFocalLength_m = 0.016;
  for (int trial = 0; trial < 200; ++trial) {
    const double distance_m = 0.3 + 0.2 * uniform(random);
    // Through a point on the axis, inclined by up to some 80 degrees to it.
    Eigen::Vector3d normal(uniform(random), uniform(random), 0.2 + std::abs(uniform(random)));
    normal.normalize();
    const double offset_m = normal.z() * distance_m;
    const auto plane = ScheimpflugPlane(normal, offset_m, kFocalLength_m);
    ASSERT_TRUE(plane.has_value());
    EXPECT_NEAR(1 / plane->image_distance_m, 1 / kFocalLength_m - 1 / distance_m, 1e-9);
    for (int i = 0; i < 20; ++i) {
      Eigen::Vector3d point(0.05 * uniform(random), 0.05 * uniform(random), 0);
      point.z() = (offset_m - normal.x() * point.x() - normal.y() * point.y()) / normal.z();
      if (point.z() < 0.05) continue;
      const double b = 1 / (1 / kFocalLength_m - 1 / point.z());
      const double u = b * point.x() / point.z(), v = b * point.y() / point.z();
      EXPECT_NEAR(plane->image_distance_m + plane->slope_u * u + plane->slope_v * v, b, 1e-12);
    }
  }
}

// In the coordinates of the perpendicular sensor: the chief ray's place on the tilted one has that
// distance.
TEST(Scheimpflug, VergenceIsThatOfThePlaceTheChiefRayMeets) {
  const SensorPlane plane{0.017, 0.1, -0.2};
  for (const double u : {-3e-3, 0.0, 2e-3}) {
    for (const double v : {-2e-3, 1e-3}) {
      const double b = 1 / SensorVergence(plane, u, v);
      const double scale = b / plane.image_distance_m;
      EXPECT_NEAR(b, plane.image_distance_m + scale * (plane.slope_u * u + plane.slope_v * v),
                  1e-15);
    }
  }
}

// Scheimpflug's rule: lens plane, object plane and sensor plane share a line.
TEST(Scheimpflug, ThreePlanesMeetInOneLine) {
  const Eigen::Vector3d normal = Eigen::Vector3d(0, std::cos(0.5), std::sin(0.5));
  const double offset_m = 0.3 * normal.z();
  const auto plane = ScheimpflugPlane(normal, offset_m, 0.016);
  ASSERT_TRUE(plane.has_value());
  // In the lens plane the object plane is at y = offset/n_y; the sensor, at z = -b behind the lens
  // with v = -y, meets it where b(v) = 0.
  const double v = -plane->image_distance_m / plane->slope_v;
  EXPECT_NEAR(-v, offset_m / normal.y(), 1e-12);
}

TEST(Scheimpflug, PerpendicularPlaneNeedsNoTilt) {
  const auto plane = ScheimpflugPlane({0, 0, 1}, 0.4, 0.016);
  ASSERT_TRUE(plane.has_value());
  EXPECT_EQ(plane->slope_u, 0);
  EXPECT_EQ(plane->slope_v, 0);
}

TEST(Scheimpflug, PlanesThatCannotBeImagedHaveNone) {
  EXPECT_FALSE(ScheimpflugPlane({1, 0, 0}, 0, 0.016).has_value());  // through the lens
  EXPECT_FALSE(
      ScheimpflugPlane({0, 0, 1}, 0.01, 0.016).has_value());  // nearer than the focal length
  EXPECT_FALSE(ScheimpflugPlane({0, 0, 1}, 0.016, 0.016).has_value());  // image at infinity
}

}  // namespace
}  // namespace sightline
