// SPDX-License-Identifier: Apache-2.0
// The point of a surface that is nearest to a measured one.
//
// A bounding-box hierarchy over the triangles. Libraries of nearest neighbours (nanoflann) search
// points: samples of a surface that is dense enough for exact distances are many, and those on the
// wrong side of a wall are all in the way.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/part/mesh.h"

namespace sightline {

// A point within so many standard deviations of its noise of an edge may belong to the other face.
inline constexpr double kSureDeviations = 2;

struct SurfacePoint {
  uint32_t triangle = 0;
  Eigen::Vector3d position_m;  // on the triangle
  Eigen::Vector3d normal;      // of the triangle, unit length
  double distance_m = 0;       // of the point asked for from `position_m`, >= 0
  // Along the triangle's normal, positive outside.
  double Deviation(const Eigen::Vector3d& point_m) const {
    return normal.dot(point_m - position_m);
  }
};

class SurfaceIndex {
 public:
  // `mesh` must outlive the index.
  explicit SurfaceIndex(const TriangleMesh& mesh);

  // Nearest point within `reach_m` on triangles that face the way of `facing` (normals within 90
  // degrees; zero: any), so that the other side of a thin wall is no candidate. Of several equally
  // near the triangle of the smallest index. None: there is no such triangle so near. Thread-safe.
  std::optional<SurfacePoint> Nearest(const Eigen::Vector3d& point_m, const Eigen::Vector3d& facing,
                                      double reach_m) const;

  // Whether the surface around `on` out to about `radius_m` is one face: at four places that far
  // off in its tangent plane, the nearest surface is nearer than a fifth of that and its normal
  // within 20 degrees.
  bool OnOneFace(const SurfacePoint& on, double radius_m) const;
  // Whether a point that belongs to `on` comes near no other face when it is moved by up to `steps`
  // times `step_m` to either side: within half a step of the way, all surface that faces the way of
  // `facing` has a normal within 20 degrees of that at `on`, and lies within a quarter of a step of
  // the plane there.
  bool NoOtherFaceAlong(const Eigen::Vector3d& point_m, const Eigen::Vector3d& step_m, int steps,
                        const SurfacePoint& on, const Eigen::Vector3d& facing) const;

  const TriangleMesh& mesh() const { return mesh_; }

 private:
  // A leaf holds triangles order_[begin, end); another node has its children at begin and end.
  struct Node {
    Eigen::AlignedBox3d box;
    uint32_t begin, end;
    bool leaf;
  };
  // Nearest, among triangles of which candidate(triangle, its nearest point) holds.
  template <typename Candidate>
  std::optional<SurfacePoint> Search(const Eigen::Vector3d& point_m, const Eigen::Vector3d& facing,
                                     double reach_m, const Candidate& candidate) const;
  uint32_t Divide(uint32_t begin, uint32_t end, const std::vector<Eigen::AlignedBox3d>& boxes);

  const TriangleMesh& mesh_;
  std::vector<Eigen::Vector3d> normals_;  // of the triangles
  std::vector<uint32_t> order_;           // triangles with an area
  std::vector<Node> nodes_;
  uint32_t root_ = 0;
};

}  // namespace sightline
