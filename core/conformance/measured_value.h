// SPDX-License-Identifier: Apache-2.0
// The value of a characteristic from the measured deviations of its targets, its uncertainty, and
// the decision whether the part conforms (ISO 14253-1:2017).
//
// The value comes from the linear functionals that also predict the uncertainty of a plan
// (FitCharacteristic), applied to the measured deviations:
//   profile      twice the largest |deviation| of a target in the datum system (ISO 1101:2017)
//   form         range of what the fit of the surface leaves, or width of the minimum zone
//   position     twice the largest displacement c_k . p of axis, centre or plane
//   orientation  largest fall c_k . p over the surface
//   size         size of the model plus the change c . p
//   angle        change of the arc at the reference length
//
// The decision is that of core/conformance/acceptance.h, where its guard bands are described.
//
//   auto fit = FitCharacteristic(feature, characteristic);
//   auto value = EvaluateMeasured(feature, *fit, deviations_m, {.width_m = 1e-4});
//   if (value.ok() && value->decision == Conformity::kConforms) Accept();
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/conformance/acceptance.h"
#include "core/conformance/characteristic.h"
#include "core/conformance/conformance.h"
#include "core/conformance/decision.h"
#include "core/conformance/feature.h"

namespace sightline {

struct MeasuredValue {
  // The value, from the targets that are known and the one that rejects the part.
  double value_m = 0;
  double uncertainty_m = 0;  // standard uncertainty of the value
  double bias_m = 0;  // of form: range that errors make of a perfect feature; part of the value
  // Contains the true value with a probability of at least 95.4 %.
  Interval interval;
  Conformity decision = Conformity::kUndecided;
  std::string because;  // a sentence that begins with the decision, with figures
  TargetCounts counts;
  int worst_target = -1;  // profiles: index into Feature::targets
  // Profiles: the smallest and the largest deviation of these targets, with signs.
  std::optional<Interval> deviations;
};

// Factor by which uncertainties are expanded (JCGM 100, 6.2).
inline constexpr double kExpansion = 2;

// `deviations_m`: one per target of the feature [m] along its normal; deviations of unused targets
// are ignored. Uncertainties of targets, scans and pose are those of the measurement. `options`:
// rule, required share, counts and seed as in JudgeCharacteristic; production is ignored. With too
// few measured targets the decision stays open unless non-conformity is proven.
//
// INVALID_ARGUMENT: CheckFeature fails, a deviation of a used target is not finite, or the zone has
// no width. FAILED_PRECONDITION: no target is used.
absl::StatusOr<MeasuredValue> EvaluateMeasured(const Feature& feature, const CharacteristicFit& fit,
                                               const Eigen::VectorXd& deviations_m,
                                               const MeasuredZone& zone,
                                               const ConformanceOptions& options = {});

}  // namespace sightline
