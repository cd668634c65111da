// SPDX-License-Identifier: Apache-2.0
#include "core/rig/sensor_bodies.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/physics/angle.h"

namespace sightline {
namespace {

double Overlap(const Rig& rig, double distance_m, double triangulation_deg) {
  Measurement m;
  m.camera_distance_m = distance_m;
  m.triangulation_angle_rad = triangulation_deg * kRadPerDeg;
  m.camera_polar_rad = 0.5;
  m.camera_azimuth_rad = 1;
  return SensorBodyOverlap(rig, MakeScanGeometry(rig, m));
}

TEST(SensorBodyOverlap, DefaultBodiesNeedRoom) {
  const Rig rig;
  EXPECT_EQ(Overlap(rig, 0.4, 30), 0);
  EXPECT_EQ(Overlap(rig, 0.4, -30), 0);
  EXPECT_GT(Overlap(rig, 0.1, 15), 0.01);
  EXPECT_GT(Overlap(rig, 0.1, -15), 0.01);
}

// Two plates that face the origin, thin along the view: their inner corners meet where
// (distance - thickness / 2) tan(angle / 2) is half a width, since they are mirror images.
TEST(SensorBodyOverlap, BeginsWhereCornersMeet) {
  Rig rig;
  rig.camera_bodies = rig.laser_bodies = {BoxBody{{0, 0, 0}, {0.06, 0.06, 0.002}}};
  const double half_angle = 15 * kRadPerDeg;
  const double touching_m = 0.03 / std::tan(half_angle) + 0.001;
  EXPECT_EQ(Overlap(rig, touching_m + 1e-5, 30), 0);
  EXPECT_GT(Overlap(rig, touching_m - 1e-5, 30), 0);
  EXPECT_LT(Overlap(rig, touching_m - 1e-5, 30), 1e-5);
}

TEST(SensorBodyOverlap, DeepestOfAllPairs) {
  Rig rig;
  rig.laser_bodies.push_back(BoxBody{{0, 0, 0.35}, {0.02, 0.02, 0.02}});  // near the origin
  rig.camera_bodies.push_back(CylinderBody{{0, 0, 0.4}, 0.005, 0.02});    // at the origin
  const double depth_m = Overlap(rig, 0.4, 30);
  EXPECT_EQ(depth_m, 0);
  rig.camera_bodies.push_back(CylinderBody{{0, 0, 0.4}, 0.06, 0.1});
  EXPECT_GT(Overlap(rig, 0.4, 30), 0.005);
  rig.camera_bodies.clear();
  EXPECT_EQ(Overlap(rig, 0.1, 10), 0);
}

}  // namespace
}  // namespace sightline
