// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::Vector3d;

// Differences of displacements over the surface.
std::vector<TwistRow> Falls(const MotionFrame& frame, const FeatureElement& element) {
  const NominalSurface& s = element.surface;
  std::vector<TwistRow> rows;
  if (s.kind == SurfaceKind::kPlane) {
    const auto at = [&](const Vector3d& d) {
      const auto farthest =
          std::max_element(element.targets.begin(), element.targets.end(), [&](int a, int b) {
            const auto& targets = frame.feature().targets;
            return d.dot(targets[static_cast<size_t>(a)].position_m) <
                   d.dot(targets[static_cast<size_t>(b)].position_m);
          });
      return frame.Displacement(frame.feature().targets[static_cast<size_t>(*farthest)].position_m,
                                s.axis);
    };
    for (const Vector3d& d : DirectionsAcross(s.axis)) rows.emplace_back(at(d) - at(-d));
  } else if (s.kind == SurfaceKind::kCylinder || s.kind == SurfaceKind::kCone) {
    const Vector3d along = ExtentAlong(frame, element, s.axis) * s.axis;
    for (const Vector3d& d : DirectionsAcross(s.axis)) {
      rows.emplace_back(frame.Displacement(s.point_m + along, d) -
                        frame.Displacement(s.point_m, d));
    }
  }
  return rows;
}

}  // namespace

absl::StatusOr<CharacteristicFit> FitOrientation(const MotionFrame& frame,
                                                 const Characteristic& c) {
  if (c.datums.empty() && !c.exact_datum) return absl::UnimplementedError("it names no datum");
  for (const FeatureElement& element : c.elements) {
    const SurfaceKind kind = element.surface.kind;
    if (kind == SurfaceKind::kPlane || kind == SurfaceKind::kCylinder || kind == SurfaceKind::kCone)
      continue;
    return absl::UnimplementedError(
        absl::StrCat("it binds a ", SurfaceKindName(kind), ", which has no orientation"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto datum, DatumMotion(frame, c, /*remaining_with_sizes=*/true));
  SIGHTLINE_ASSIGN_OR_RETURN(auto stacked, EachByItself(frame, c.elements, &datum));
  CharacteristicFit result;
  result.measurand = Measurand::kOrientation;
  result.zone = ZoneKind::kOneSided;
  result.fit.used = frame.used();
  result.fit.toleranced = TolerancedTargets(c);
  result.fit.estimator = stacked.estimator;
  std::vector<Eigen::RowVectorXd> rows;
  for (size_t e = 0; e < c.elements.size(); ++e) {
    for (const TwistRow& fall : Falls(frame, c.elements[e])) {
      Eigen::RowVectorXd& row =
          rows.emplace_back(Eigen::RowVectorXd::Zero(stacked.estimator.rows()));
      row.segment<6>(stacked.first_row[e]) = fall;
      row.tail<6>() -= fall;
    }
  }
  result.fit.functionals = RowsToMatrix(rows, stacked.estimator.rows());
  return result;
}

}  // namespace sightline
