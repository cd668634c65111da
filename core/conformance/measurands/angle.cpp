// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::Vector3d;

// Full angle of a cone as the arc over its generatrix.
Eigen::RowVectorXd OpeningOfCone(const MotionFrame& frame, const FeatureElement& cone,
                                 const StackedEstimates& stacked, double* reference_m) {
  *reference_m =
      ExtentAlong(frame, cone, cone.surface.axis) / std::cos(cone.surface.half_angle_rad);
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(stacked.estimator.rows());
  row(stacked.size_row(0)) = 2 * *reference_m / frame.scale_m();
  return row;
}

}  // namespace

absl::StatusOr<CharacteristicFit> FitAngle(const MotionFrame& frame, const Characteristic& c) {
  const bool cone = c.elements.size() == 1 && c.elements.front().surface.kind == SurfaceKind::kCone;
  const bool planes = c.elements.size() == 2 && c.elements[0].surface.kind == SurfaceKind::kPlane &&
                      c.elements[1].surface.kind == SurfaceKind::kPlane;
  if (!cone && !planes) {
    return absl::UnimplementedError("angles are evaluated on a cone and between two planes only");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto stacked, EachByItself(frame, c.elements, nullptr));
  CharacteristicFit result;
  result.measurand = Measurand::kSize;
  result.fit.used = frame.used();
  result.fit.toleranced = TolerancedTargets(c);
  result.fit.estimator = stacked.estimator;
  if (cone) {
    result.fit.functionals =
        OpeningOfCone(frame, c.elements[0], stacked, &result.reference_length_m);
    return result;
  }
  const Vector3d edge = c.elements[0].surface.axis.cross(c.elements[1].surface.axis);
  if (!(edge.norm() > 1e-3)) {
    return absl::UnimplementedError("it binds parallel planes, which have no angle");
  }
  // Across the common edge, the shorter plane is the less certain side of the angle.
  const Vector3d d = edge.normalized();
  result.reference_length_m =
      std::min(ExtentAlong(frame, c.elements[0], c.elements[0].surface.axis.cross(d)),
               ExtentAlong(frame, c.elements[1], c.elements[1].surface.axis.cross(d)));
  result.fit.functionals = Eigen::MatrixXd::Zero(1, stacked.estimator.rows());
  const Eigen::RowVector3d arc = result.reference_length_m / frame.scale_m() * d.transpose();
  result.fit.functionals.row(0).segment<3>(stacked.first_row[0] + 3) = arc;
  result.fit.functionals.row(0).segment<3>(stacked.first_row[1] + 3) = -arc;
  return result;
}

}  // namespace sightline
