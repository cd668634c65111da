// SPDX-License-Identifier: Apache-2.0
#include "planning/requirements/faces_on_part.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"

namespace sightline {
namespace {

// Number of points compared per face, in addition to three per triangle.
constexpr double kPointsPerFace = 2000;
// Largest number of compared triangles of a face; a larger face is subsampled evenly.
constexpr size_t kMostComparedTriangles = 20000;

// Calls visit(point, normal) at the corners of every triangle and at a grid between them, with
// about the same spacing in all triangles.
template <typename Visit>
void ForPointsOfFace(const FaceTriangles& face, const Visit& visit) {
  double area_m2 = 0;
  const auto corner = [&](size_t t, size_t c) { return face.positions_m[face.triangles[t][c]]; };
  const auto normal_of = [&](size_t t) -> Eigen::Vector3d {
    return (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
  };
  for (size_t t = 0; t < face.triangles.size(); ++t) area_m2 += 0.5 * normal_of(t).norm();
  if (!(area_m2 > 0)) return;
  const double spacing_m = std::sqrt(area_m2 / kPointsPerFace);
  const size_t stride = face.triangles.size() / kMostComparedTriangles + 1;
  for (size_t t = 0; t < face.triangles.size(); t += stride) {
    const Eigen::Vector3d normal = normal_of(t);
    if (!(normal.norm() > 0)) continue;
    const Eigen::Vector3d a = corner(t, 0), b = corner(t, 1), c = corner(t, 2);
    // Slivers are long but have little area, so the area determines the fineness of the grid.
    const double steps = std::clamp(std::sqrt(normal.norm()) / spacing_m, 1.0, 100.0);
    const int count = static_cast<int>(std::ceil(steps));
    for (int i = 0; i <= count; ++i) {
      for (int j = 0; i + j <= count; ++j) {
        const double u = static_cast<double>(i) / count, v = static_cast<double>(j) / count;
        visit(Eigen::Vector3d((1 - u - v) * a + u * b + v * c), normal);
      }
    }
  }
}

}  // namespace

FacesOnPart::FacesOnPart(const TriangleMesh& part, double most_distance_m)
    : part_(part),
      part_size_m_(part.BoundingBox().sizes().norm()),
      most_distance_m_(most_distance_m) {}

FacesOnPart::Farthest FacesOnPart::FarthestPoint(const FaceTriangles& face) {
  if (!surface_) surface_.emplace(part_);
  std::optional<Farthest> farthest;
  ForPointsOfFace(face, [&](const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal) {
    if (surface_->Nearest(point_m, normal, most_distance_m_)) return;
    const auto any = surface_->Nearest(point_m, Eigen::Vector3d::Zero(),
                                       std::max(part_size_m_, most_distance_m_));
    // No surface within the part's size: the distance from the part's middle is a rough estimate.
    const double distance_m =
        any ? any->distance_m
            : (part_.BoundingBox().center() - point_m).norm() - 0.5 * part_size_m_;
    if (!farthest || distance_m > farthest->distance_m) {
      farthest = Farthest{distance_m, point_m, distance_m <= most_distance_m_};
    }
  });
  return farthest.value_or(Farthest{});
}

absl::Status FacesOnPart::Check(const FaceTriangles& face, const std::string& binds) {
  const auto [entry, fresh] = known_.try_emplace(face.face);
  if (fresh) entry->second = FarthestPoint(face);
  const Farthest& farthest = entry->second;
  const Eigen::Vector3d place_mm = 1e3 * farthest.place_m;
  if (farthest.inside_out) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: face %d is on the part's mesh at (%.3f, %.3f, %.3f) mm but faces the other way: the "
        "mesh is inside out there, or it is of another revision of the part",
        binds, face.face, place_mm.x(), place_mm.y(), place_mm.z()));
  }
  if (!(farthest.distance_m > most_distance_m_)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrFormat(
      "%s: face %d lies %.3f mm off the part's mesh at (%.3f, %.3f, %.3f) mm, at most %.3f mm are "
      "allowed: the tolerances are of another revision of the part, in another unit or in other "
      "coordinates, or the mesh is coarser than that",
      binds, face.face, 1e3 * farthest.distance_m, place_mm.x(), place_mm.y(), place_mm.z(),
      1e3 * most_distance_m_));
}

}  // namespace sightline
