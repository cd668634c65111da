// SPDX-License-Identifier: Apache-2.0
// The free parameters of a surface in fits.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <span>
#include <vector>

#include "core/association/nominal_surface.h"

namespace sightline {

// Points relative to their mean in units of their extent, so that all numbers are of order 1.
struct NormalisedCloud {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double scale_m = 1;
  std::vector<Eigen::Vector3d> points;

  explicit NormalisedCloud(std::span<const Eigen::Vector3d> points_m) {
    for (const Eigen::Vector3d& p : points_m) centre_m += p / static_cast<double>(points_m.size());
    double extent_m = 0;
    for (const Eigen::Vector3d& p : points_m) extent_m = std::max(extent_m, (p - centre_m).norm());
    if (extent_m > 0) scale_m = extent_m;
    for (const Eigen::Vector3d& p : points_m) points.push_back((p - centre_m) / scale_m);
  }

  // Converts a surface from the units of the points, and back.
  NominalSurface Normalised(NominalSurface s) const {
    s.point_m = (s.point_m - centre_m) / scale_m;
    s.radius_m /= scale_m;
    s.tube_radius_m /= scale_m;
    return s;
  }
  NominalSurface InMetres(NominalSurface s) const {
    s.point_m = centre_m + scale_m * s.point_m;
    s.radius_m *= scale_m;
    s.tube_radius_m *= scale_m;
    return s;
  }
};

// Parameters of a surface relative to a start: shift of its point, tilt of its axis, its sizes.
struct SurfaceParameters {
  NominalSurface start;
  Eigen::Vector3d across, other;
  // Indices of the free parameters: 0 to 2 shift (across, other, axis), 3 and 4 tilt, 5 to 7 sizes.
  std::vector<int> used;

  explicit SurfaceParameters(const NominalSurface& s) : start(s) {
    across = s.axis.unitOrthogonal();
    other = s.axis.cross(across);
    switch (s.kind) {
      case SurfaceKind::kFreeform:
        break;
      case SurfaceKind::kPlane:
        used = {2, 3, 4};
        break;
      case SurfaceKind::kCylinder:
        used = {0, 1, 3, 4, 5};
        break;
      case SurfaceKind::kCone:
        used = {0, 1, 2, 3, 4, 7};
        break;
      case SurfaceKind::kSphere:
        used = {0, 1, 2, 5};
        break;
      case SurfaceKind::kTorus:
        used = {0, 1, 2, 3, 4, 5, 6};
        break;
    }
  }

  NominalSurface At(const Eigen::VectorXd& x) const {
    Eigen::Matrix<double, 8, 1> all = Eigen::Matrix<double, 8, 1>::Zero();
    for (size_t k = 0; k < used.size(); ++k) all(used[k]) = x(static_cast<Eigen::Index>(k));
    NominalSurface s = start;
    s.point_m += all(0) * across + all(1) * other + all(2) * start.axis;
    s.axis = (start.axis + all(3) * across + all(4) * other).normalized();
    s.radius_m += all(5);
    s.tube_radius_m += all(6);
    s.half_angle_rad += all(7);
    return s;
  }
};

// Signed distances of points from the surface of some parameters; a functor for Eigen's solvers.
struct SurfaceDistances {
  using Scalar = double;
  using InputType = Eigen::VectorXd;
  using ValueType = Eigen::VectorXd;
  using JacobianType = Eigen::MatrixXd;
  enum { InputsAtCompileTime = Eigen::Dynamic, ValuesAtCompileTime = Eigen::Dynamic };

  const SurfaceParameters& parameters;
  const std::vector<Eigen::Vector3d>& points;

  int inputs() const { return static_cast<int>(parameters.used.size()); }
  int values() const { return static_cast<int>(points.size()); }
  int operator()(const Eigen::VectorXd& x, Eigen::VectorXd& distances) const {
    const NominalSurface s = parameters.At(x);
    for (size_t i = 0; i < points.size(); ++i) {
      distances[static_cast<Eigen::Index>(i)] = SignedDistance(s, points[i]);
    }
    return 0;
  }
};

}  // namespace sightline
