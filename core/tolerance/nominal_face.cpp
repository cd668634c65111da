// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/nominal_face.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <utility>

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

  // A point is inside if a ray from it crosses the boundary an odd number of times. Without corners
  // every point is inside.
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

// Triangles within a distance of the surface, and their area.
struct Found {
  FaceTriangles face;
  double area_m2 = 0;
};

Found TrianglesWithin(double distance_m, const NominalFace& face, const NominalSurface& surface,
                      const TriangleMesh& mesh) {
  Found found;
  found.face.face = face.face;
  const Outline outline(face.outline_m, surface.axis);
  const auto on = [&](const Vector3d& p) {
    if (!(std::abs(SignedDistance(surface, p)) <= distance_m)) return false;
    return std::all_of(face.slabs.begin(), face.slabs.end(), [&](const NominalFace::Slab& slab) {
      const double along_m = slab.direction.dot(p);
      return along_m >= slab.lower_m - distance_m && along_m <= slab.upper_m + distance_m;
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
    const auto first = static_cast<uint32_t>(found.face.positions_m.size());
    found.face.positions_m.insert(found.face.positions_m.end(), corners.begin(), corners.end());
    found.face.triangles.push_back({first, first + 1, first + 2});
    found.area_m2 += mesh.Area(t);
  }
  return found;
}

// All of the face's triangles, or none if a part of them lies off the surface.
FaceTriangles TrianglesOn(const NominalFace& face, const NominalSurface& surface,
                          const TriangleMesh& mesh) {
  // Facets of a fillet that runs out into the surface lie near it too.
  constexpr double kNearlyAll = 0.9;
  Found on = TrianglesWithin(kOnNominalSurface_m, face, surface, mesh);
  if (on.face.triangles.empty()) return {face.face, {}, {}};
  const Found near = TrianglesWithin(kNearNominalSurface_m, face, surface, mesh);
  if (on.area_m2 < kNearlyAll * near.area_m2) return {face.face, {}, {}};
  return std::move(on.face);
}

}  // namespace

std::vector<FaceTriangles> FacesOnMesh(std::span<const NominalFace> faces,
                                       const TriangleMesh& mesh) {
  std::vector<FaceTriangles> found;
  std::set<std::string> missed;  // features
  std::vector<const std::string*> feature_of;
  for (const NominalFace& face : faces) {
    FaceTriangles on{face.face, {}, {}};
    if (face.surface.kind != SurfaceKind::kFreeform) on = TrianglesOn(face, face.surface, mesh);
    if (on.triangles.empty() && face.alternative) on = TrianglesOn(face, *face.alternative, mesh);
    if (on.triangles.empty()) {
      missed.insert(face.feature);
      continue;
    }
    found.push_back(std::move(on));
    feature_of.push_back(&face.feature);
  }
  std::vector<FaceTriangles> whole;
  for (size_t i = 0; i < found.size(); ++i) {
    if (!missed.contains(*feature_of[i])) whole.push_back(std::move(found[i]));
  }
  return whole;
}

}  // namespace sightline
