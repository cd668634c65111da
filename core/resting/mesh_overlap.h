// SPDX-License-Identifier: Apache-2.0
// Overlap of two bodies: volume and depth.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>

#include "core/part/mesh.h"

namespace sightline {

struct MeshOverlap {
  // Volume of the intersection.
  double volume_m3 = 0;
  // Longest chord through the intersection along x, y and z; the least of the three is the depth of
  // one body in the other.
  double extent_m[3] = {0, 0, 0};

  double depth_m() const { return std::min({extent_m[0], extent_m[1], extent_m[2]}); }
};

// Overlap of `a`, moved by `to_b`, with `b`: along 192 x 192 lines in each of the three directions
// the stretches inside both are compared, exactly along the lines. So parts thinner than 1/192 of
// the space shared by both bounding boxes may be missed. Lines that cross a surface an
// odd number of times (it is not closed there) are left out.
MeshOverlap OverlapOf(const TriangleMesh& a, const Eigen::Isometry3d& to_b, const TriangleMesh& b);

}  // namespace sightline
