// SPDX-License-Identifier: Apache-2.0
// Bounding-volume hierarchy over a triangle mesh for the exact evaluator: any-hit segments, nearby
// triangles, and overlap with convex bodies. The tests compare with Embree, so the server does not
// use it; Embree also has neither swept bodies nor our bundles of rays.
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/part/mesh.h"
#include "core/rig/zonotope.h"

namespace sightline {

class TriangleBvh {
 public:
  // If *cancelled becomes true meanwhile, the hierarchy has no triangles.
  explicit TriangleBvh(const TriangleMesh& mesh, const std::atomic<bool>* cancelled = nullptr);

  // Tests eight segments with the common start `from`: Kay-Kajiya box and Moeller-Trumbore triangle
  // tests in float; both sides of a triangle occlude. Segment i ends at to[i]; its last part, the
  // fraction gap[i], does not count. Lanes cleared in `active` are not tested. Returns the occluded
  // lanes.
  static constexpr int kLanes = 8;
  struct Bundle {
    alignas(32) float to_x[kLanes], to_y[kLanes], to_z[kLanes];
    alignas(32) float gap[kLanes];  // fraction of the segment left out at its end
  };
  uint32_t Occluded(const Eigen::Vector3f& from, const Bundle& bundle, uint32_t active) const;

  // Tests one segment; `gap_m` is the length left out at its end.
  bool Occluded(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float gap_m) const;

  // Calls visit(triangle index) for every triangle whose box meets the box.
  void VisitBox(const Eigen::AlignedBox3f& box, const std::function<void(uint32_t)>& visit) const;

  // True if a triangle touches the solid (separating axes, exact for triangles).
  bool Overlaps(const Zonotope& solid) const;

  // True if a triangle of `other`, moved by x -> rotation x + shift and then anywhere between
  // -half_sweep and +half_sweep, touches a triangle of this mesh (separating axes, exact).
  bool Touches(const TriangleBvh& other, const Eigen::Matrix3d& rotation,
               const Eigen::Vector3d& shift, const Eigen::Vector3d& half_sweep) const;

  const Eigen::AlignedBox3f& bounds() const { return bounds_; }
  size_t bytes() const;

 private:
  struct Node {
    float min[3];
    float max[3];
    // Leaf: first triangle and count; inner: index of the left child (right follows) and 0.
    uint32_t first;
    uint32_t count;
  };
  // Vertex and two edges, in leaf order.
  struct Triangle {
    float v[3], e1[3], e2[3];
    uint32_t index;
  };

  void Build(const TriangleMesh& mesh, const std::atomic<bool>* cancelled);

  // Calls visit(triangle) for every triangle whose node meets the box, until it returns true.
  template <typename Visit>
  bool AnyInBox(const Eigen::AlignedBox3f& box, const Visit& visit) const;

  std::vector<Node> nodes_;
  std::vector<Triangle> triangles_;
  Eigen::AlignedBox3f bounds_;
};

}  // namespace sightline
