// SPDX-License-Identifier: Apache-2.0
// Surfaces that features of drawings consist of: plane, cylinder, cone, sphere and torus, fitted
// to points by least squares (Gauss).
//
//   auto hole = RecogniseSurface(vertices_m, normals);
//   if (hole.kind == SurfaceKind::kCylinder) Use(hole.axis, hole.radius_m);
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace sightline {

enum class SurfaceKind { kFreeform, kPlane, kCylinder, kCone, kSphere, kTorus };

// "plane", "cylinder", ...; "free-form surface".
const char* SurfaceKindName(SurfaceKind kind);

struct NominalSurface {
  SurfaceKind kind = SurfaceKind::kFreeform;
  // A point of the plane or of the cylinder's axis; apex of the cone; centre of sphere and torus.
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  // Unit vector: normal of the plane; axis of cylinder, cone and torus. A cone opens along it.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  double radius_m = 0;        // cylinder and sphere; for a torus, circle of the tube's centres
  double tube_radius_m = 0;   // torus
  double half_angle_rad = 0;  // cone, in (0, pi/2)
};

// Distance [m] of a point from the surface: positive along the plane's normal, and outside
// cylinder, cone, sphere and tube. 0 for free-form surfaces.
double SignedDistance(const NominalSurface& surface, const Eigen::Vector3d& point_m);

// Unit vector along which the signed distance of a point grows fastest; `fallback` for free-form
// surfaces and on an axis or centre, where there is none.
Eigen::Vector3d DistanceGradient(const NominalSurface& surface, const Eigen::Vector3d& point_m,
                                 const Eigen::Vector3d& fallback);

// Least-squares surface of that kind through points whose normals (unit, of either side) are known
// roughly: the normals give a start in closed form, Levenberg-Marquardt minimises the sum of
// squared distances from it. nullopt: too few points, points that do not determine the surface, or
// a kind that is not fitted (free form).
std::optional<NominalSurface> FitSurface(SurfaceKind kind,
                                         std::span<const Eigen::Vector3d> points_m,
                                         std::span<const Eigen::Vector3d> normals);

struct Recognition {
  // Largest distance of a point from the surface [m]. Vertices of a CAD model's triangulation lie
  // on its surfaces within rounding.
  double most_distance_m = 1e-5;
  // Largest angle between a point's normal and that of the surface [rad].
  double most_normal_angle_rad = 0.3;
};

// The first kind, in the order of SurfaceKind, whose fit has all points within the limits. Free
// form if there is none, or if the points are too few to determine a curved surface. `points_m`
// and `normals` are equally many.
NominalSurface RecogniseSurface(std::span<const Eigen::Vector3d> points_m,
                                std::span<const Eigen::Vector3d> normals,
                                const Recognition& limits = {});

// Whether two surfaces are one and the same within `most_distance_m`, such as the halves of a bore
// or coplanar faces. Free-form surfaces are never the same.
bool SameSurface(const NominalSurface& a, const NominalSurface& b, double most_distance_m = 1e-5);

}  // namespace sightline
