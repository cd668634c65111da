// SPDX-License-Identifier: Apache-2.0
// Hard constraints: bodies against part, fixtures and table.
#include "coverage_server/collision/collision.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/core/part/test_meshes.h"
#include "tests/coverage_server/test_parts.h"

namespace sightline {
namespace {

constexpr double kHair = 1e-4;  // 0.1 mm

// Camera above the origin: its body is 60 x 60 x 120 mm with the front at z = 0.4.
struct OverheadRig {
  Rig rig;
  Measurement measurement = OverheadMeasurement(0.5);
  OverheadRig() {
    rig.camera_bodies = {BoxBody{{0, 0, -0.06}, {0.06, 0.06, 0.12}}};
    rig.laser_bodies.clear();
  }
};

// A box given in the world (stage at 0) as a mesh in the frame of an occluder.
std::vector<Occluder> WorldBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                               ObstacleFrame frame, const ScanGeometry& geometry,
                               const Eigen::Vector3d& part_centre_m) {
  TriangleMesh mesh = BoxMesh(low.cast<float>(), high.cast<float>());
  for (auto& p : mesh.positions_m) {
    Eigen::Vector3d x = p.cast<double>();
    if (frame != ObstacleFrame::kWorld) x -= geometry.part_offset_m;
    if (frame == ObstacleFrame::kPart) x = geometry.part_rotation.transpose() * x + part_centre_m;
    p = x.cast<float>();
  }
  std::vector<Occluder> occluders;
  occluders.push_back({frame, TriangleBvh(mesh)});
  return occluders;
}

TEST(Collision, AHairDecidesInEveryFrame) {
  OverheadRig s;
  s.measurement.part_alpha_rad = 0.4;
  s.measurement.part_beta_rad = 1.1;
  s.measurement.part_gamma_rad = 2.3;
  s.measurement.offset_y_m = 0.07;
  s.measurement.offset_z_m = -0.03;
  const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
  const Eigen::Vector3d centre(0.11, -0.2, 0.05);
  for (const auto frame : {ObstacleFrame::kPart, ObstacleFrame::kStage, ObstacleFrame::kWorld}) {
    const auto hits = [&](const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
      return Collides(s.rig, g, centre, WorldBox(low, high, frame, g, centre), 0, 0);
    };
    for (const double gap : {kHair, -kHair}) {
      const bool touches = gap < 0;
      EXPECT_EQ(hits({-0.1, -0.1, 0.38}, {0.1, 0.1, 0.4 - gap}), touches);  // plate below the front
      EXPECT_EQ(hits({0.03 + gap, -0.1, 0.42}, {0.1, 0.1, 0.44}), touches);  // beside it
      EXPECT_EQ(hits({-0.1, 0.03 + gap, 0.42}, {0.1, 0.2, 0.44}), touches);
      EXPECT_EQ(hits({-0.1, -0.1, 0.52 + gap}, {0.1, 0.1, 0.6}), touches);  // above its back
    }
    // Wholly inside the body: its surface is inside, so that is a collision too.
    EXPECT_TRUE(hits({-0.01, -0.01, 0.45}, {0.01, 0.01, 0.46}));
  }
}

// With a clearance the body is as much larger on every side, against part, table and what stands
// still; the bodies of camera and laser may still touch one another.
TEST(Collision, KeepsTheClearance) {
  OverheadRig s;
  s.rig.clearance_m = 0.005;
  const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
  const Eigen::Vector3d centre(0, 0, 0);
  for (const auto frame : {ObstacleFrame::kPart, ObstacleFrame::kStage, ObstacleFrame::kTable,
                           ObstacleFrame::kWorld}) {
    for (const double gap_m : {s.rig.clearance_m + kHair, s.rig.clearance_m - kHair}) {
      const auto hits = [&](const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
        return Collides(s.rig, g, centre, WorldBox(low, high, frame, g, centre), 0, 0);
      };
      const bool too_near = gap_m < s.rig.clearance_m;
      EXPECT_EQ(hits({-0.1, -0.1, 0.38}, {0.1, 0.1, 0.4 - gap_m}), too_near);
      EXPECT_EQ(hits({0.03 + gap_m, -0.1, 0.42}, {0.1, 0.1, 0.44}), too_near);
      EXPECT_EQ(hits({-0.1, -0.1, 0.52 + gap_m}, {0.1, 0.1, 0.6}), too_near);
    }
  }
  s.rig.camera_bodies = {CylinderBody{{0, 0, -0.06}, 0.03, 0.12}};
  for (const double gap_m : {s.rig.clearance_m + kHair, s.rig.clearance_m - kHair}) {
    const auto below =
        WorldBox({-0.1, -0.1, 0.38}, {0.1, 0.1, 0.4 - gap_m}, ObstacleFrame::kWorld, g, centre);
    EXPECT_EQ(Collides(s.rig, g, centre, below, 0, 0), gap_m < s.rig.clearance_m);
  }
}

TEST(Collision, TravelIsSwept) {
  OverheadRig s;
  const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
  const Eigen::Vector3d centre(0, 0, 0);
  // Part and stage obstacles move by +s; the box starts left of the camera.
  for (const auto frame : {ObstacleFrame::kPart, ObstacleFrame::kStage}) {
    for (const double gap : {kHair, -kHair}) {
      const double travel = 0.25;
      const auto box =
          WorldBox({-0.4, -0.1, 0.45}, {-0.03 - travel - gap, 0.1, 0.46}, frame, g, centre);
      EXPECT_FALSE(Collides(s.rig, g, centre, box, 0, 0));
      EXPECT_EQ(Collides(s.rig, g, centre, box, 0, travel), gap < 0);
      EXPECT_FALSE(Collides(s.rig, g, centre, box, -travel, 0));
    }
    // Touches only half-way: free at both ends of the travel.
    const auto thin = WorldBox({-0.101, -0.1, 0.45}, {-0.1, 0.1, 0.46}, frame, g, centre);
    EXPECT_FALSE(Collides(s.rig, g, centre, thin, 0, 0));
    EXPECT_FALSE(Collides(s.rig, g, centre, thin, 0.2, 0.2));
    EXPECT_TRUE(Collides(s.rig, g, centre, thin, 0, 0.2));
  }
  // An obstacle in the world frame does not move.
  const auto still =
      WorldBox({-0.4, -0.1, 0.45}, {-0.03 - kHair, 0.1, 0.46}, ObstacleFrame::kWorld, g, centre);
  EXPECT_FALSE(Collides(s.rig, g, centre, still, -0.5, 0.5));
}

TEST(Collision, PartMayNotRunIntoWhatStandsStill) {
  OverheadRig s;
  s.rig.camera_bodies.clear();
  s.measurement.part_alpha_rad = 0.4;
  s.measurement.part_beta_rad = 1.1;
  s.measurement.part_gamma_rad = 2.3;
  s.measurement.offset_y_m = 0.07;
  const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
  const Eigen::Vector3d centre(0.11, -0.2, 0.05);
  const auto scene = [&](ObstacleFrame frame, double post_y_m) {
    auto occluders =
        WorldBox({-0.1, -0.05, -0.05}, {0.1, 0.05, 0.05}, ObstacleFrame::kPart, g, centre);
    auto post = WorldBox({0.3, post_y_m, -0.2}, {0.32, post_y_m + 0.01, 0.2}, frame, g, centre);
    occluders.push_back(std::move(post[0]));
    return occluders;
  };
  const auto hits = [&](const std::vector<Occluder>& occluders, double start_m, double end_m) {
    return Collides(s.rig, g, centre, occluders, start_m, end_m);
  };
  const auto still = scene(ObstacleFrame::kWorld, 0.0);
  EXPECT_FALSE(hits(still, -0.5, 0.2 - kHair));
  EXPECT_TRUE(hits(still, -0.5, 0.2 + kHair));
  EXPECT_TRUE(hits(still, 0.2 + kHair, 0.2 + kHair));
  // Passing through between two stops counts too; beside it there is room.
  EXPECT_TRUE(hits(still, 0.0, 0.9));
  EXPECT_FALSE(hits(still, 0.42 + kHair, 0.9));
  EXPECT_FALSE(hits(scene(ObstacleFrame::kWorld, 0.05 + kHair), 0.0, 0.9));
  // An obstacle that travels along is never hit.
  EXPECT_FALSE(hits(scene(ObstacleFrame::kStage, 0.0), 0.0, 0.9));
}

TEST(Collision, LaserBodyCounts) {
  OverheadRig s;
  s.rig.camera_bodies.clear();
  s.rig.laser_bodies = {BoxBody{{0, 0, -0.06}, {0.04, 0.04, 0.12}}};
  s.measurement.triangulation_angle_rad = std::numbers::pi / 2;  // laser along -x, at x = -0.4
  const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
  for (const double gap : {kHair, -kHair}) {
    const auto box =
        WorldBox({-0.4 + gap, -0.1, -0.1}, {0.1, 0.1, 0.1}, ObstacleFrame::kWorld, g, {0, 0, 0});
    EXPECT_EQ(Collides(s.rig, g, {0, 0, 0}, box, 0, 0), gap < 0);
  }
}

// Their thin plates face the origin, mirror images of each other: inner corners meet where
// (distance - thickness / 2) tan(angle / 2) is half a width.
TEST(Collision, CameraAndLaserNeedRoomBesideEachOther) {
  OverheadRig s;
  s.rig.camera_bodies = s.rig.laser_bodies = {BoxBody{{0, 0, 0}, {0.06, 0.06, 0.002}}};
  s.measurement.triangulation_angle_rad = 0.5;
  for (const double gap : {kHair, -kHair}) {
    s.measurement.camera_distance_m = 0.03 / std::tan(0.25) + 0.001 + gap;
    const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
    const auto far_away = WorldBox({1, 1, 1}, {1.1, 1.1, 1.1}, ObstacleFrame::kPart, g, {0, 0, 0});
    EXPECT_EQ(Collides(s.rig, g, {0, 0, 0}, far_away, 0, 0), gap < 0);
  }
  // Bodies that are drawn as touching do not collide.
  s.rig.camera_bodies = {BoxBody{{0, 0, 0}, {0.02, 0.02, 0.02}}};
  s.rig.laser.distance_m = s.measurement.camera_distance_m = 0.3;
  s.measurement.triangulation_angle_rad = 0;
  s.rig.laser_bodies = {BoxBody{{0.02, 0, 0}, {0.02, 0.02, 0.02}}};
  const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
  const auto far_away = WorldBox({1, 1, 1}, {1.1, 1.1, 1.1}, ObstacleFrame::kPart, g, {0, 0, 0});
  EXPECT_FALSE(Collides(s.rig, g, {0, 0, 0}, far_away, 0, 0));
}

TEST(Collision, CylinderIsEnclosedButNotByMuch) {
  OverheadRig s;
  s.rig.camera_bodies = {CylinderBody{{0, 0, -0.05}, 0.04, 0.1}};
  const ScanGeometry g = MakeScanGeometry(s.rig, s.measurement);
  // An octagon about a circle reaches 1 / cos(22.5 degrees) = 1.0824 times as far at its corners.
  for (int k = 0; k < 48; ++k) {
    const double a = 2 * std::numbers::pi * k / 48;
    const auto needle = [&](double r) {
      TriangleMesh mesh;
      const Eigen::Vector3d tip(r * std::cos(a), r * std::sin(a), 0.45);
      const Eigen::Vector3d out(0.05 * std::cos(a), 0.05 * std::sin(a), 0);
      mesh.positions_m = {tip.cast<float>(),
                          (tip + out + Eigen::Vector3d(0, 0, 1e-3)).cast<float>(),
                          (tip + out).cast<float>()};
      mesh.triangles = {{0, 1, 2}};
      std::vector<Occluder> occluders;
      occluders.push_back({ObstacleFrame::kWorld, TriangleBvh(mesh)});
      return Collides(s.rig, g, {0, 0, 0}, occluders, 0, 0);
    };
    EXPECT_TRUE(needle(0.04 - kHair)) << k;
    EXPECT_FALSE(needle(0.04 * 1.0824 + kHair)) << k;
  }
}

// Distance between a zonotope and a triangle by minimisation, one variable at a time: no
// separating axes involved.
double Distance(const Zonotope& solid, const Eigen::Vector3d* corners) {
  std::vector<double> t(solid.generators_m.size(), 0);
  double weight[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
  Eigen::Vector3d r = solid.centre_m - (corners[0] + corners[1] + corners[2]) / 3;
  for (int sweep = 0; sweep < 3000; ++sweep) {
    const double before = r.squaredNorm();
    for (size_t i = 0; i < t.size(); ++i) {
      const Eigen::Vector3d& g = solid.generators_m[i];
      const double next = std::clamp(t[i] - g.dot(r) / g.squaredNorm(), -1.0, 1.0);
      r += (next - t[i]) * g;
      t[i] = next;
    }
    for (int i = 0; i < 3; ++i) {  // move weight from corner i to corner j
      const int j = (i + 1) % 3;
      const Eigen::Vector3d d = corners[i] - corners[j];  // change of r per weight moved
      const double moved = std::clamp(-d.dot(r) / d.squaredNorm(), -weight[j], weight[i]);
      weight[i] -= moved;
      weight[j] += moved;
      r += moved * d;
    }
    if (before - r.squaredNorm() < 1e-16) break;
  }
  return r.norm();
}

TEST(Collision, ZonotopeOverlapsWhenItsDistanceIsZero) {
  Random random(21);
  int apart = 0, together = 0, undecided = 0;
  for (int i = 0; i < 4000; ++i) {
    Zonotope solid;
    solid.centre_m = 0.05 * random.Direction();
    const int generators = 3 + static_cast<int>(random.Next() % 3);
    for (int k = 0; k < generators; ++k) {
      solid.generators_m.push_back(random.Uniform(0.01, 0.06) * random.Direction());
    }
    TriangleMesh mesh;
    Eigen::Vector3d corners[3];
    const Eigen::Vector3d middle = random.Uniform(0.02, 0.25) * random.Direction();
    for (auto& c : corners) {
      const Eigen::Vector3f rounded =
          (middle + random.Uniform(0.01, 0.1) * random.Direction()).cast<float>();
      mesh.positions_m.push_back(rounded);
      c = rounded.cast<double>();
    }
    mesh.triangles = {{0, 1, 2}};
    const bool overlaps = TriangleBvh(mesh).Overlaps(solid);
    const double distance = Distance(solid, corners);
    // Minimisation one variable at a time stalls near corners; leave out what is nearly touching.
    if (distance > 1e-6 && distance < 2e-3) {
      ++undecided;
      continue;
    }
    EXPECT_EQ(overlaps, distance <= 1e-6) << i << " distance " << distance;
    (overlaps ? together : apart) += 1;
  }
  EXPECT_GT(together, 500);
  EXPECT_GT(apart, 500);
  EXPECT_LT(undecided, 400);
}

TEST(Collision, NeverFreeWithAPointOfTheSurfaceInside) {
  const TriangleMesh part = BlindHolePart();
  const TriangleBvh bvh(part);
  // Points on every triangle.
  std::vector<Eigen::Vector3d> samples;
  for (size_t t = 0; t < part.triangles.size(); ++t) {
    constexpr int kSteps = 6;
    for (int i = 0; i <= kSteps; ++i) {
      for (int j = 0; i + j <= kSteps; ++j) {
        samples.push_back(
            (i * part.Corner(t, 0) + j * part.Corner(t, 1) + (kSteps - i - j) * part.Corner(t, 2)) /
            kSteps);
      }
    }
  }
  Random random(22);
  int hit = 0, free = 0, close_calls = 0;
  for (int i = 0; i < 600; ++i) {
    Zonotope box;
    box.centre_m = Eigen::Vector3d(random.Uniform(-0.07, 0.07), random.Uniform(-0.07, 0.07),
                                   random.Uniform(-0.03, 0.08));
    const Eigen::Matrix3d axes =
        Eigen::AngleAxisd(random.Uniform(0, 3), random.Direction()).toRotationMatrix();
    const Eigen::Vector3d half(random.Uniform(0.001, 0.02), random.Uniform(0.001, 0.02),
                               random.Uniform(0.001, 0.02));
    for (int k = 0; k < 3; ++k) box.generators_m.push_back(half[k] * axes.col(k));
    bool inside = false, near = false;
    for (const auto& p : samples) {
      const Eigen::Vector3d x = (axes.transpose() * (p - box.centre_m)).cwiseAbs();
      inside |= (x.array() < half.array() - 1e-7).all();
      // Samples are at most 1.5 mm apart.
      near |= (x.array() < half.array() + 1.5e-3).all();
    }
    const bool overlaps = bvh.Overlaps(box);
    if (inside) {
      EXPECT_TRUE(overlaps) << i;
    }
    if (!near) {
      EXPECT_FALSE(overlaps) << i;
    }
    hit += inside;
    free += !near;
    close_calls += near && !inside;
  }
  EXPECT_GT(hit, 100);
  EXPECT_GT(free, 100);
  EXPECT_LT(close_calls, 200);
}

}  // namespace
}  // namespace sightline
