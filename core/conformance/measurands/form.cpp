// SPDX-License-Identifier: Apache-2.0
#include "absl/strings/str_cat.h"
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

bool HasForm(ToleranceKind kind, SurfaceKind surface) {
  if (kind == ToleranceKind::kFlatness) return surface == SurfaceKind::kPlane;
  if (kind == ToleranceKind::kCylindricity) return surface == SurfaceKind::kCylinder;
  if (kind == ToleranceKind::kRoundness) {
    return surface != SurfaceKind::kPlane && surface != SurfaceKind::kFreeform;
  }
  return surface == SurfaceKind::kPlane || surface == SurfaceKind::kCylinder ||
         surface == SurfaceKind::kCone;
}

}  // namespace

absl::StatusOr<CharacteristicFit> FitForm(const MotionFrame& frame, const Characteristic& c) {
  for (const FeatureElement& element : c.elements) {
    if (HasForm(c.kind, element.surface.kind)) continue;
    return absl::UnimplementedError(absl::StrCat("it binds a ",
                                                 SurfaceKindName(element.surface.kind),
                                                 ", on which this form is not evaluated"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto stacked, EachByItself(frame, c.elements, nullptr));
  CharacteristicFit result;
  result.measurand = Measurand::kForm;
  result.zone = ZoneKind::kOneSided;
  FeatureFit& fit = result.fit;
  fit.used = frame.used();
  fit.toleranced = TolerancedTargets(c);
  fit.estimator = stacked.estimator;
  fit.association = c.association;
  fit.design =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(fit.toleranced.size()), fit.estimator.rows());
  Eigen::Index row = 0;
  for (size_t e = 0; e < c.elements.size(); ++e) {
    const FeatureElement& element = c.elements[e];
    const Eigen::MatrixXd sizes = SizeColumns(frame, element, element.targets);
    const auto count = static_cast<Eigen::Index>(element.targets.size());
    fit.design.block(row, stacked.size_row(e), count, sizes.cols()) = sizes;
    for (const int t : element.targets) {
      fit.design.row(row++).segment<6>(stacked.first_row[e]) = frame.Deviation(element, t);
      fit.surface_of.push_back(static_cast<int>(e));
    }
  }
  return result;
}

}  // namespace sightline
