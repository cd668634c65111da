// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::Vector3d;

// Unit vectors all over the sphere (Fibonacci lattice), within 0.15 rad of any direction.
std::vector<Vector3d> DirectionsAround() {
  constexpr int kCount = 200;
  std::vector<Vector3d> directions;
  for (int k = 0; k < kCount; ++k) {
    const double z = 1 - (2.0 * k + 1) / kCount, away = std::sqrt(1 - z * z);
    const double angle = std::numbers::pi * (3 - std::sqrt(5.0)) * k;
    directions.emplace_back(away * std::cos(angle), away * std::sin(angle), z);
  }
  return directions;
}

// Displacements of the surface's derived feature: axis, centre or (median) plane.
std::vector<TwistRow> Displacements(const MotionFrame& frame, const FeatureElement& element) {
  const NominalSurface& s = element.surface;
  std::vector<TwistRow> rows;
  if (s.kind == SurfaceKind::kPlane) {
    for (const int t : element.targets) {
      const Vector3d& x = frame.feature().targets[static_cast<size_t>(t)].position_m;
      rows.push_back(frame.Displacement(x, s.axis));
      rows.push_back(frame.Displacement(x, -s.axis));
    }
  } else if (s.kind == SurfaceKind::kSphere) {
    for (const Vector3d& d : DirectionsAround()) rows.push_back(frame.Displacement(s.point_m, d));
  } else if (s.kind != SurfaceKind::kFreeform) {
    const double middle = s.axis.dot(frame.Centre(element) - s.point_m);
    const double half_m = 0.5 * ExtentAlong(frame, element, s.axis);
    for (const double along : {middle - half_m, middle + half_m}) {
      for (const Vector3d& d : DirectionsAcross(s.axis)) {
        rows.push_back(frame.Displacement(s.point_m + along * s.axis, d));
      }
    }
  }
  return rows;
}

// Derivative of (displacement - departure of the half size from its material limit) with respect to
// the column of the size: under the maximum material requirement a hole gives room as it grows and
// a pin as it shrinks.
double RoomOfSize(const MotionFrame& frame, const FeatureElement& element,
                  MaterialRequirement material) {
  const bool sized = element.width || element.surface.kind == SurfaceKind::kCylinder ||
                     element.surface.kind == SurfaceKind::kSphere;
  if (!sized || material == MaterialRequirement::kNone) return 0;
  const bool room_by_growth =
      IsInner(frame, element) == (material == MaterialRequirement::kMaximum);
  return (room_by_growth ? -1 : 1) * HalfSizePerColumn(frame, element);
}

}  // namespace

absl::StatusOr<CharacteristicFit> FitPosition(const MotionFrame& frame, const Characteristic& c) {
  if (c.datums.empty() && !c.exact_datum && c.elements.size() < 2) {
    return absl::UnimplementedError("it names no datum, and one surface by itself has no place");
  }
  for (const FeatureElement& element : c.elements) {
    if (element.surface.kind != SurfaceKind::kFreeform) continue;
    return absl::UnimplementedError("it binds a free-form surface, which has no axis or centre");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto datum, DatumMotion(frame, c, /*remaining_with_sizes=*/true));
  SIGHTLINE_ASSIGN_OR_RETURN(auto stacked, EachByItself(frame, c.elements, &datum));
  CharacteristicFit result;
  result.measurand = Measurand::kPosition;
  result.fit.used = frame.used();
  result.fit.toleranced = TolerancedTargets(c);
  result.fit.estimator = stacked.estimator;
  std::vector<Eigen::RowVectorXd> rows;
  for (size_t e = 0; e < c.elements.size(); ++e) {
    for (const TwistRow& displacement : Displacements(frame, c.elements[e])) {
      Eigen::RowVectorXd& row =
          rows.emplace_back(Eigen::RowVectorXd::Zero(stacked.estimator.rows()));
      row.segment<6>(stacked.first_row[e]) = displacement;
      row.tail<6>() -= displacement;
      const double room = RoomOfSize(frame, c.elements[e], c.material);
      if (room != 0) row(stacked.size_row(e)) = room;
    }
  }
  result.fit.functionals = RowsToMatrix(rows, stacked.estimator.rows());
  return result;
}

}  // namespace sightline
