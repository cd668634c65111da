// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/target_uncertainty.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

absl::Status WrongSize(const std::string& context, absl::string_view field, size_t size,
                       size_t expected, absl::string_view what) {
  return absl::InvalidArgumentError(
      absl::StrFormat("%s: %s has size %d, must be %d (%s)", context, field, size, expected, what));
}

template <class T>
absl::Status CheckValues(const std::string& context, const std::string& field,
                         const std::vector<T>& values) {
  for (size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i]) && values[i] >= 0) continue;
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: %s[%d] is %g, must be finite and at least 0 m", context, field, i, values[i]));
  }
  return absl::OkStatus();
}

}  // namespace

UncertaintyClass ClassOfTarget(const TargetUncertainties& uncertainties,
                               const TargetBits& measurable, size_t target) {
  if (!measurable.Test(target)) return UncertaintyClass::kNotMeasurable;
  const double admissible_m = uncertainties.admissible_m[target];
  if (admissible_m == 0) return UncertaintyClass::kNotToleranced;
  const double total_m = uncertainties.total_m[target];
  if (total_m <= admissible_m) return UncertaintyClass::kAdmissible;
  return total_m <= uncertainties.relaxed_m ? UncertaintyClass::kRelaxed
                                            : UncertaintyClass::kNotReached;
}

UncertaintyPart DominatingPart(const TargetUncertainties& uncertainties, size_t target) {
  UncertaintyPart part = UncertaintyPart::kNoise;
  double largest_m = uncertainties.noise_m[target];
  for (const auto& [candidate, values] :
       {std::pair{UncertaintyPart::kSampling, &uncertainties.sampling_m},
        std::pair{UncertaintyPart::kCalibration, &uncertainties.calibration_m},
        std::pair{UncertaintyPart::kRegistration, &uncertainties.registration_m}}) {
    if (values->empty() || (*values)[target] <= largest_m) continue;
    part = candidate;
    largest_m = (*values)[target];
  }
  return part;
}

absl::Status CheckTargetUncertainties(const TargetUncertainties& uncertainties, size_t targets,
                                      size_t scans, size_t features, const std::string& context) {
  for (const auto& [field, values] :
       {std::pair{"total_m", &uncertainties.total_m}, std::pair{"noise_m", &uncertainties.noise_m},
        std::pair{"sampling_m", &uncertainties.sampling_m},
        std::pair{"calibration_m", &uncertainties.calibration_m},
        std::pair{"registration_m", &uncertainties.registration_m},
        std::pair{"admissible_m", &uncertainties.admissible_m}}) {
    if (values == &uncertainties.registration_m && values->empty()) continue;
    if (values->size() != targets)
      return WrongSize(context, field, values->size(), targets, "number of targets");
    SIGHTLINE_RETURN_IF_ERROR(CheckValues(context, field, *values));
  }
  if (!(std::isfinite(uncertainties.relaxed_m) && uncertainties.relaxed_m >= 0)) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s: relaxed_m is %g, must be finite and at least 0 m", context, uncertainties.relaxed_m));
  }
  if (!uncertainties.limits.empty() && uncertainties.limits.size() != targets)
    return WrongSize(context, "limits", uncertainties.limits.size(), targets, "number of targets");
  const auto& maps = uncertainties.scan_sensitivities;
  if (!maps.empty() && maps.size() != scans)
    return WrongSize(context, "scan_sensitivities", maps.size(), scans, "number of scans");
  for (size_t i = 0; i < maps.size(); ++i) {
    const std::string field = absl::StrCat("scan_sensitivities[", i, "]");
    const size_t points = maps[i].positions_m.size();
    if (maps[i].detection_m.size() != points) {
      return WrongSize(context, field + ".detection_m", maps[i].detection_m.size(), points,
                       "number of points");
    }
    if (!maps[i].calibration_m.empty() && maps[i].calibration_m.size() != points) {
      return WrongSize(context, field + ".calibration_m", maps[i].calibration_m.size(), points,
                       "number of points, or none");
    }
    for (size_t p = 0; p < points; ++p) {
      if (maps[i].positions_m[p].allFinite()) continue;
      return absl::InvalidArgumentError(
          absl::StrFormat("%s: %s.positions_m[%d] is not finite", context, field, p));
    }
    SIGHTLINE_RETURN_IF_ERROR(CheckValues(context, field + ".detection_m", maps[i].detection_m));
    SIGHTLINE_RETURN_IF_ERROR(
        CheckValues(context, field + ".calibration_m", maps[i].calibration_m));
  }
  const auto& lists = uncertainties.feature_targets;
  if (!lists.empty() && lists.size() != features)
    return WrongSize(context, "feature_targets", lists.size(), features, "number of features");
  for (size_t f = 0; f < lists.size(); ++f) {
    for (const uint32_t target : lists[f]) {
      if (target < targets) continue;
      return absl::InvalidArgumentError(absl::StrFormat(
          "%s: feature_targets[%d] names target %d; there are %d", context, f, target, targets));
    }
  }
  return absl::OkStatus();
}

}  // namespace sightline
