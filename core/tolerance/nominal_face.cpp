// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/nominal_face.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// cos(0.3 rad): half the angle between facets of a coarsely triangulated surface.
constexpr double kFaces = 0.955;

// A boundary in the plane, for points in it.
class Outline {
 public:
  Outline(const std::vector<Vector3d>& points_m, const Vector3d& normal)
      : x_(normal.unitOrthogonal()), y_(normal.cross(x_)) {
    for (const Vector3d& p : points_m) corners_.push_back(In(p));
  }

  // By the parity of crossings of a ray; without corners everything is inside.
  bool Holds(const Vector3d& p) const {
    if (corners_.size() < 3) return true;
    const Vector2d q = In(p);
    bool inside = false;
    for (size_t i = 0, j = corners_.size() - 1; i < corners_.size(); j = i++) {
      const Vector2d &a = corners_[i], &b = corners_[j];
      if ((a.y() > q.y()) == (b.y() > q.y())) continue;
      const double x = a.x() + (q.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      if (q.x() < x) inside = !inside;
    }
    return inside;
  }

 private:
  Vector2d In(const Vector3d& p) const { return {x_.dot(p), y_.dot(p)}; }

  Vector3d x_, y_;
  std::vector<Vector2d> corners_;
};

FaceTriangles TrianglesOn(const NominalFace& face, const NominalSurface& surface,
                          const TriangleMesh& mesh) {
  FaceTriangles found;
  found.face = face.face;
  const Outline outline(face.outline_m, surface.axis);
  const auto on = [&](const Vector3d& p) {
    if (!(std::abs(SignedDistance(surface, p)) <= kOnNominalSurface_m)) return false;
    return std::all_of(face.slabs.begin(), face.slabs.end(), [&](const NominalFace::Slab& slab) {
      const double along_m = slab.direction.dot(p);
      return along_m >= slab.lower_m - kOnNominalSurface_m &&
             along_m <= slab.upper_m + kOnNominalSurface_m;
    });
  };
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::array<Vector3d, 3> corners = {mesh.Corner(t, 0), mesh.Corner(t, 1),
                                             mesh.Corner(t, 2)};
    if (!on(corners[0]) || !on(corners[1]) || !on(corners[2])) continue;
    const Vector3d centre = (corners[0] + corners[1] + corners[2]) / 3;
    const Vector3d normal = mesh.Normal(t);
    const double facing = normal.dot(DistanceGradient(surface, centre, normal));
    if (face.side == 0 ? std::abs(facing) < kFaces : face.side * facing < kFaces) continue;
    if (!outline.Holds(centre)) continue;
    const auto first = static_cast<uint32_t>(found.positions_m.size());
    found.positions_m.insert(found.positions_m.end(), corners.begin(), corners.end());
    found.triangles.push_back({first, first + 1, first + 2});
  }
  return found;
}

}  // namespace

std::vector<FaceTriangles> FacesOnMesh(std::span<const NominalFace> faces,
                                       const TriangleMesh& mesh) {
  std::vector<FaceTriangles> found;
  for (const NominalFace& face : faces) {
    FaceTriangles on = TrianglesOn(face, face.surface, mesh);
    if (on.triangles.empty() && face.alternative) on = TrianglesOn(face, *face.alternative, mesh);
    if (!on.triangles.empty()) found.push_back(std::move(on));
  }
  return found;
}

}  // namespace sightline
