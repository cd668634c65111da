// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {

absl::StatusOr<CharacteristicFit> FitProfile(const MotionFrame& frame, const Characteristic& c) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto datum, DatumMotion(frame, c, /*remaining_with_sizes=*/false));
  CharacteristicFit result;
  FeatureFit& fit = result.fit;
  // The motion of a minimum zone is that of all targets together, and so is the value.
  fit.about_model = c.association == Association::kChebyshev;
  fit.association = c.association;
  result.measurand = fit.about_model ? Measurand::kForm : Measurand::kDeviation;
  result.zone = fit.about_model ? ZoneKind::kOneSided : ZoneKind::kTwoSided;
  fit.used = frame.used();
  fit.toleranced = TolerancedTargets(c);
  fit.estimator = datum.estimator;
  fit.design.resize(static_cast<Eigen::Index>(fit.toleranced.size()), 6);
  Eigen::Index row = 0;
  for (const FeatureElement& element : c.elements) {
    for (const int t : element.targets) fit.design.row(row++) = frame.Deviation(element, t);
  }
  return result;
}

}  // namespace sightline
