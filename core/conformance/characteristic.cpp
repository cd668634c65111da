// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/characteristic.h"

#include "core/conformance/measurands/measurands.h"
#include "core/conformance/measurands/rigid_motion.h"

namespace sightline {

bool HasMinimumZone(ToleranceKind kind, bool has_datums) {
  switch (kind) {
    case ToleranceKind::kFlatness:
    case ToleranceKind::kStraightness:
    case ToleranceKind::kRoundness:
    case ToleranceKind::kCylindricity:
      return true;
    case ToleranceKind::kSurfaceProfile:
    case ToleranceKind::kLineProfile:
      return !has_datums;
    default:
      return false;
  }
}

absl::StatusOr<CharacteristicFit> FitCharacteristic(const Feature& feature,
                                                    const Characteristic& c) {
  if (c.elements.empty()) return absl::UnimplementedError("it binds no surface");
  if (c.association == Association::kChebyshev &&
      !HasMinimumZone(c.kind, c.exact_datum || !c.datums.empty())) {
    return absl::UnimplementedError(
        "association CHEBYSHEV is evaluated for form and for profiles without datums only");
  }
  const MotionFrame frame(feature, c.elements);
  switch (c.kind) {
    case ToleranceKind::kFlatness:
    case ToleranceKind::kStraightness:
    case ToleranceKind::kRoundness:
    case ToleranceKind::kCylindricity:
      return FitForm(frame, c);
    case ToleranceKind::kSurfaceProfile:
    case ToleranceKind::kLineProfile:
      return FitProfile(frame, c);
    case ToleranceKind::kPosition:
    case ToleranceKind::kConcentricity:
    case ToleranceKind::kCoaxiality:
    case ToleranceKind::kSymmetry:
      return FitPosition(frame, c);
    case ToleranceKind::kParallelism:
    case ToleranceKind::kPerpendicularity:
    case ToleranceKind::kAngularity:
      return FitOrientation(frame, c);
    case ToleranceKind::kCircularRunout:
    case ToleranceKind::kTotalRunout:
      return FitRunout(frame, c);
    case ToleranceKind::kLinearSize:
    case ToleranceKind::kLinearDistance:
      return FitSize(frame, c);
    case ToleranceKind::kAngularSize:
    case ToleranceKind::kAngularDistance:
      return FitAngle(frame, c);
  }
  return absl::UnimplementedError("its kind is not known");
}

}  // namespace sightline
