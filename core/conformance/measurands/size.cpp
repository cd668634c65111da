// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::Vector3d;

// The point of a surface from which distances are measured: its centre, or the point of its plane
// or axis in the middle of its targets.
Vector3d MiddleOf(const MotionFrame& frame, const FeatureElement& element) {
  const NominalSurface& s = element.surface;
  const Vector3d centre = frame.Centre(element);
  if (s.kind == SurfaceKind::kSphere || s.kind == SurfaceKind::kTorus) return s.point_m;
  const double along = s.axis.dot(centre - s.point_m);
  if (s.kind == SurfaceKind::kPlane) return element.width ? centre : centre - along * s.axis;
  return s.point_m + along * s.axis;
}

// Unit direction in which the distance of two surfaces is measured; zero if there is none.
Vector3d DirectionBetween(const MotionFrame& frame, const FeatureElement& a,
                          const FeatureElement& b) {
  const auto is_plane = [](const FeatureElement& e) {
    return e.surface.kind == SurfaceKind::kPlane;
  };
  if (is_plane(a) && is_plane(b) && std::abs(a.surface.axis.dot(b.surface.axis)) < 0.9999)
    return Vector3d::Zero();
  if (is_plane(a)) return a.surface.axis;
  if (is_plane(b)) return b.surface.axis;
  Vector3d d = MiddleOf(frame, b) - MiddleOf(frame, a);
  for (const FeatureElement* e : {&a, &b}) {
    if (e->surface.kind == SurfaceKind::kCylinder || e->surface.kind == SurfaceKind::kCone)
      d -= e->surface.axis.dot(d) * e->surface.axis;
  }
  return d.norm() > 1e-9 ? d.normalized() : Vector3d::Zero();
}

// The size that the model's surface has [m].
double OwnSize(const MotionFrame& frame, const FeatureElement& element, bool radius) {
  const NominalSurface& s = element.surface;
  if (element.width) return ExtentAlong(frame, element, s.axis);
  return (radius ? 1 : 2) * (s.kind == SurfaceKind::kTorus ? s.tube_radius_m : s.radius_m);
}

// Whether the surface has a size that a single dimension states.
bool HasOwnSize(const FeatureElement& element) {
  const SurfaceKind kind = element.surface.kind;
  return element.width || kind == SurfaceKind::kCylinder || kind == SurfaceKind::kSphere ||
         kind == SurfaceKind::kTorus;
}

}  // namespace

absl::StatusOr<CharacteristicFit> FitSize(const MotionFrame& frame, const Characteristic& c) {
  const bool distance = c.kind == ToleranceKind::kLinearDistance ||
                        std::none_of(c.elements.begin(), c.elements.end(), HasOwnSize);
  const bool single_width = c.elements.size() == 1 && c.elements.front().width;
  for (const FeatureElement& element : c.elements) {
    if (element.surface.kind == SurfaceKind::kFreeform)
      return absl::UnimplementedError("it binds a free-form surface, which has no size");
    if (!distance && !HasOwnSize(element)) {
      return absl::UnimplementedError(absl::StrCat("it binds a ",
                                                   SurfaceKindName(element.surface.kind),
                                                   " among surfaces that have a size"));
    }
  }
  if (distance && c.elements.size() < 2 && !single_width) {
    return absl::UnimplementedError(absl::StrCat("it binds one ",
                                                 SurfaceKindName(c.elements.front().surface.kind),
                                                 "; a distance needs two surfaces"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto stacked, EachByItself(frame, c.elements, nullptr));
  const Eigen::Index columns = stacked.estimator.rows();
  std::vector<Eigen::RowVectorXd> rows;
  std::vector<double> sizes_m;
  if (distance && !single_width) {
    for (size_t e = 1; e < c.elements.size(); ++e) {
      Vector3d d = DirectionBetween(frame, c.elements[0], c.elements[e]);
      if (d.isZero()) {
        return absl::UnimplementedError(
            "its surfaces are not parallel, or are concentric, and have no distance");
      }
      const Vector3d apart_m = MiddleOf(frame, c.elements[e]) - MiddleOf(frame, c.elements[0]);
      if (d.dot(apart_m) < 0) d = -d;
      sizes_m.push_back(d.dot(apart_m));
      Eigen::RowVectorXd& row = rows.emplace_back(Eigen::RowVectorXd::Zero(columns));
      row.segment<6>(stacked.first_row[0]) = -frame.Displacement(MiddleOf(frame, c.elements[0]), d);
      row.segment<6>(stacked.first_row[e]) = frame.Displacement(MiddleOf(frame, c.elements[e]), d);
    }
  } else {
    for (size_t e = 0; e < c.elements.size(); ++e) {
      // The first size of a torus is the tube's radius, which is the radius of a fillet.
      Eigen::RowVectorXd& row = rows.emplace_back(Eigen::RowVectorXd::Zero(columns));
      row(stacked.size_row(e)) = (c.radius ? 1 : 2) * HalfSizePerColumn(frame, c.elements[e]);
      sizes_m.push_back(OwnSize(frame, c.elements[e], c.radius));
    }
  }
  CharacteristicFit result;
  result.measurand = Measurand::kSize;
  result.fit.used = frame.used();
  result.fit.toleranced = TolerancedTargets(c);
  result.fit.estimator = stacked.estimator;
  result.fit.functionals = RowsToMatrix(rows, columns);
  result.model_sizes_m = std::move(sizes_m);
  return result;
}

}  // namespace sightline
