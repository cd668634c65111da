// SPDX-License-Identifier: Apache-2.0
#include "core/association/surface_curvature.h"

#include <Eigen/Geometry>

namespace sightline {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// With the unit normal N, the direction around the axis c = axis x N / |axis x N| and the direction
// along the meridian m = N x c, surfaces of revolution have H = k_c c c' + k_m m m'. By Meusnier's
// theorem k_c = N . e_r / r at the distance r from the axis, where e_r points away from it.
Matrix3d DistanceHessian(const NominalSurface& s, const Vector3d& point_m) {
  if (s.kind == SurfaceKind::kFreeform || s.kind == SurfaceKind::kPlane) return Matrix3d::Zero();
  const Vector3d normal = DistanceGradient(s, point_m, Vector3d::Zero());
  if (normal.isZero(0)) return Matrix3d::Zero();
  if (s.kind == SurfaceKind::kSphere) {
    return (Matrix3d::Identity() - normal * normal.transpose()) / s.radius_m;
  }
  const Vector3d from_point = point_m - s.point_m;
  const Vector3d radial = from_point - s.axis.dot(from_point) * s.axis;
  const double away_m = radial.norm();
  if (!(away_m > 0)) return Matrix3d::Zero();
  const Vector3d around = s.axis.cross(radial) / away_m;
  Matrix3d hessian = normal.dot(radial) / (away_m * away_m) * around * around.transpose();
  if (s.kind == SurfaceKind::kTorus) {
    const Vector3d meridian = normal.cross(around);
    hessian += meridian * meridian.transpose() / s.tube_radius_m;
  }
  return hessian;
}

}  // namespace sightline
