// SPDX-License-Identifier: Apache-2.0
// The triangulated faces of a part's model, and which of them a point of another mesh lies on.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

// Triangulation of one face, in part coordinates (those of the GLB of the same import).
struct FaceTriangles {
  int face = 0;  // counted from 1 in the order of the import
  std::vector<Eigen::Vector3d> positions_m;
  // Indices into positions_m, counter-clockwise seen from outside the material.
  std::vector<std::array<uint32_t, 3>> triangles;
};

struct FaceMatch {
  // Largest distance of a point from the face [m]. (0, 0.1]. Chords of two triangulations of the
  // same face are up to the sum of their chord tolerances apart (default 0.05 mm each) and points
  // read from float files move by less than 1e-7 of the part's size.
  double max_distance_m = 2e-4;
  // Largest angle between the normals of point and face [rad]. (0, pi]. Facets turn by up to
  // 15 degrees from one to the next.
  double max_normal_angle_rad = 0.5235987755982988;  // 30 degrees
};

// The surface of one face, with a grid that finds the triangles near a point.
class FaceSurface {
 public:
  // INVALID_ARGUMENT: no triangle with area, an index that points nowhere, a coordinate that is not
  // finite, more than 5 million triangles, or a match outside its ranges; the message names the
  // face.
  static absl::StatusOr<FaceSurface> Make(FaceTriangles face, const FaceMatch& match = {});

  int face() const { return face_.face; }
  double area_m2() const { return area_m2_; }

  // Whether some triangle of the face is within max_distance_m of `point_m` and has a normal within
  // max_normal_angle_rad of `normal` (any length > 0). Points within that distance of the border
  // count as on the face.
  bool Contains(const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal) const;

 private:
  FaceSurface() = default;
  size_t CellOf(const Eigen::Vector3d& point_m) const;

  FaceTriangles face_;
  FaceMatch match_;
  double area_m2_ = 0;
  std::vector<Eigen::Vector3d> normals_;
  // Bounding box, grown by the distance; cells of equal size; triangles of cell c are
  // cell_triangles_[cell_begin_[c] .. cell_begin_[c + 1]).
  Eigen::Vector3d lower_m_, upper_m_;
  double cell_m_ = 1;
  std::array<size_t, 3> cells_ = {1, 1, 1};
  std::vector<uint32_t> cell_begin_, cell_triangles_;
};

// Distance [m] of a point from a triangle (Ericson, Real-Time Collision Detection, 2005, 5.1.5).
double DistanceToTriangle(const Eigen::Vector3d& point_m, const Eigen::Vector3d& a_m,
                          const Eigen::Vector3d& b_m, const Eigen::Vector3d& c_m);

// Points on any of `faces`, in ascending order. points_m and normals: equally many.
std::vector<int> PointsOnFaces(std::span<const FaceSurface> faces,
                               std::span<const Eigen::Vector3d> points_m,
                               std::span<const Eigen::Vector3d> normals);

}  // namespace sightline
