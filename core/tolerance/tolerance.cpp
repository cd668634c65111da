// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/tolerance.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/text/number_text.h"

namespace sightline {

const char* ToleranceKindName(ToleranceKind kind) {
  switch (kind) {
    case ToleranceKind::kFlatness:
      return "flatness";
    case ToleranceKind::kStraightness:
      return "straightness";
    case ToleranceKind::kRoundness:
      return "roundness";
    case ToleranceKind::kCylindricity:
      return "cylindricity";
    case ToleranceKind::kSurfaceProfile:
      return "surface profile";
    case ToleranceKind::kLineProfile:
      return "line profile";
    case ToleranceKind::kPosition:
      return "position";
    case ToleranceKind::kParallelism:
      return "parallelism";
    case ToleranceKind::kPerpendicularity:
      return "perpendicularity";
    case ToleranceKind::kAngularity:
      return "angularity";
    case ToleranceKind::kConcentricity:
      return "concentricity";
    case ToleranceKind::kCoaxiality:
      return "coaxiality";
    case ToleranceKind::kSymmetry:
      return "symmetry";
    case ToleranceKind::kCircularRunout:
      return "circular runout";
    case ToleranceKind::kTotalRunout:
      return "total runout";
    case ToleranceKind::kLinearSize:
      return "linear size";
    case ToleranceKind::kAngularSize:
      return "angular size";
    case ToleranceKind::kLinearDistance:
      return "linear distance";
    case ToleranceKind::kAngularDistance:
      return "angular distance";
  }
  return "unknown";
}

bool IsAngular(ToleranceKind kind) {
  return kind == ToleranceKind::kAngularSize || kind == ToleranceKind::kAngularDistance;
}

bool IsDimension(ToleranceKind kind) {
  return IsAngular(kind) || kind == ToleranceKind::kLinearSize ||
         kind == ToleranceKind::kLinearDistance;
}

double AdmissibleUncertainty(double zone_width_m, const DecisionRule& rule) {
  return zone_width_m * (1 - rule.least_acceptance_zone) / (2 * rule.guard_factor);
}

absl::Status CheckDecisionRule(const DecisionRule& rule) {
  if (!(rule.guard_factor > 0 && rule.guard_factor <= 10)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "decision rule: guard_factor is ", NumberText(rule.guard_factor), "; must be in (0, 10]"));
  }
  if (!(rule.least_acceptance_zone >= 0 && rule.least_acceptance_zone < 1)) {
    return absl::InvalidArgumentError(absl::StrCat("decision rule: least_acceptance_zone is ",
                                                   NumberText(rule.least_acceptance_zone),
                                                   "; must be in [0, 1)"));
  }
  return absl::OkStatus();
}

absl::Status CheckTolerance(const Tolerance& tolerance, double part_size_m) {
  const std::string who = absl::StrCat("tolerance ", tolerance.name, " (", tolerance.id, ")");
  if (IsAngular(tolerance.kind)) {
    return absl::InvalidArgumentError(
        absl::StrCat(who,
                     ": an angle has no zone width in metres; give it by hand, or tolerate "
                     "the face by its orientation or profile"));
  }
  if (!std::isfinite(tolerance.zone_width_m) || !(tolerance.zone_width_m > 0)) {
    return absl::InvalidArgumentError(absl::StrCat(
        who, ": zone_width_m is ", NumberText(tolerance.zone_width_m), "; must be finite and > 0"));
  }
  if (!(tolerance.zone_width_m < part_size_m)) {
    return absl::InvalidArgumentError(
        absl::StrCat(who, ": zone_width_m is ", NumberText(tolerance.zone_width_m),
                     "; must be less than the size of the part, ", NumberText(part_size_m),
                     " m (is the unit right?)"));
  }
  return absl::OkStatus();
}

}  // namespace sightline
