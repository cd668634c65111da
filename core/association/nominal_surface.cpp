// SPDX-License-Identifier: Apache-2.0
#include "core/association/nominal_surface.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

using Eigen::Vector3d;

// Place of a point about the axis through point_m: along it, and away from it.
struct AxisPlace {
  double along_m = 0, away_m = 0;
  Vector3d radial = Vector3d::Zero();  // unit; zero on the axis
};

AxisPlace PlaceAboutAxis(const NominalSurface& s, const Vector3d& p) {
  AxisPlace place;
  const Vector3d d = p - s.point_m;
  place.along_m = s.axis.dot(d);
  const Vector3d away = d - place.along_m * s.axis;
  place.away_m = away.norm();
  if (place.away_m > 0) place.radial = away / place.away_m;
  return place;
}

}  // namespace

const char* SurfaceKindName(SurfaceKind kind) {
  switch (kind) {
    case SurfaceKind::kFreeform:
      return "free-form surface";
    case SurfaceKind::kPlane:
      return "plane";
    case SurfaceKind::kCylinder:
      return "cylinder";
    case SurfaceKind::kCone:
      return "cone";
    case SurfaceKind::kSphere:
      return "sphere";
    case SurfaceKind::kTorus:
      return "torus";
  }
  return "surface";
}

double SignedDistance(const NominalSurface& s, const Vector3d& p) {
  const AxisPlace place = PlaceAboutAxis(s, p);
  switch (s.kind) {
    case SurfaceKind::kFreeform:
      return 0;
    case SurfaceKind::kPlane:
      return place.along_m;
    case SurfaceKind::kCylinder:
      return place.away_m - s.radius_m;
    case SurfaceKind::kCone:
      return place.away_m * std::cos(s.half_angle_rad) - place.along_m * std::sin(s.half_angle_rad);
    case SurfaceKind::kSphere:
      return (p - s.point_m).norm() - s.radius_m;
    case SurfaceKind::kTorus:
      return std::hypot(place.away_m - s.radius_m, place.along_m) - s.tube_radius_m;
  }
  return 0;
}

Vector3d DistanceGradient(const NominalSurface& s, const Vector3d& p, const Vector3d& fallback) {
  const AxisPlace place = PlaceAboutAxis(s, p);
  Vector3d gradient = Vector3d::Zero();
  switch (s.kind) {
    case SurfaceKind::kFreeform:
      break;
    case SurfaceKind::kPlane:
      return s.axis;
    case SurfaceKind::kCylinder:
      gradient = place.radial;
      break;
    case SurfaceKind::kCone:
      if (place.away_m > 0) {
        gradient = std::cos(s.half_angle_rad) * place.radial - std::sin(s.half_angle_rad) * s.axis;
      }
      break;
    case SurfaceKind::kSphere:
      gradient = p - s.point_m;
      break;
    case SurfaceKind::kTorus:
      gradient = (place.away_m - s.radius_m) * place.radial + place.along_m * s.axis;
      break;
  }
  return gradient.norm() > 0 ? gradient.normalized() : fallback;
}

bool SameSurface(const NominalSurface& a, const NominalSurface& b, double most_m) {
  if (a.kind != b.kind || a.kind == SurfaceKind::kFreeform) return false;
  const auto parallel = [&] { return std::abs(a.axis.dot(b.axis)) > 1 - 1e-8; };
  const auto off_axis = [&] { return PlaceAboutAxis(a, b.point_m).away_m; };
  const bool same_radius = std::abs(a.radius_m - b.radius_m) <= most_m;
  switch (a.kind) {
    case SurfaceKind::kFreeform:
      return false;
    case SurfaceKind::kPlane:
      return a.axis.dot(b.axis) > 1 - 1e-8 && std::abs(SignedDistance(a, b.point_m)) <= most_m;
    case SurfaceKind::kCylinder:
      return parallel() && same_radius && off_axis() <= most_m;
    case SurfaceKind::kSphere:
      return same_radius && (a.point_m - b.point_m).norm() <= most_m;
    case SurfaceKind::kCone:
      return parallel() && std::abs(a.half_angle_rad - b.half_angle_rad) < 1e-4 &&
             (a.point_m - b.point_m).norm() <= most_m;
    case SurfaceKind::kTorus:
      return parallel() && same_radius && std::abs(a.tube_radius_m - b.tube_radius_m) <= most_m &&
             (a.point_m - b.point_m).norm() <= most_m;
  }
  return false;
}

}  // namespace sightline
