// SPDX-License-Identifier: Apache-2.0
// Small parts with known geometry, random scans, and shortcuts for tests of the coverage engine.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/part/mesh.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"
#include "core/targets/target_set.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/scene/coverage_scene.h"

namespace sightline {

// Solid of revolution about z: (r, z) from the axis at the bottom to the axis at the top, the
// material on the left of the path. Closed if both ends have r = 0.
TriangleMesh Lathe(const std::vector<Eigen::Vector2d>& profile_m, int sides);

// Shaft of three steps, 120 mm across and 60 mm high: vertical walls, inner corners, 2 k triangles.
TriangleMesh SteppedPart();

// Block, 80 mm across and 50 mm high, with a blind hole of 30 mm, 25 mm deep; 3 k triangles.
TriangleMesh BlindHolePart();

// Cylinder of `outer_m` and `height_m` with a blind hole from the top.
TriangleMesh HolePart(double outer_m, double height_m, double hole_diameter_m, double hole_depth_m,
                      int sides);

// examples/cylinder_head of this repository; fails the test and returns an empty mesh without it.
TriangleMesh CylinderHead();

// splitmix64: the same numbers everywhere.
class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t Next();
  double Uniform(double low, double high);
  Eigen::Vector3d Direction();

 private:
  uint64_t state_;
};

// Camera within [0.2, 0.6] m, any azimuth and pose, triangulation angle of either sign.
Measurement RandomMeasurement(Random& random);

// Camera straight above at 0.4 m, laser tilted by `tau_rad` towards -x, part unrotated.
Measurement OverheadMeasurement(double tau_rad);

std::vector<Occluder> PartOccluder(const TriangleMesh& part);

// Fails the test and returns null on error.
std::unique_ptr<CoverageScene> BuildScene(SceneDefinition definition, int threads);

}  // namespace sightline
