// SPDX-License-Identifier: Apache-2.0
// The value of a characteristic from the measured deviations of its targets, its uncertainty, and
// the decision whether the part conforms (ISO 14253-1:2017).
//
// The value is made by the linear functionals that predict the uncertainty of a plan
// (FitCharacteristic), applied to what was measured:
//   profile      twice the largest |deviation| of a target in the datum system (ISO 1101:2017)
//   form         range of what the fit of the surface leaves
//   position     twice the largest displacement c_k . p of axis, centre or plane
//   orientation  largest fall c_k . p over the surface
//   size         size of the model plus the change c . p
//   angle        change of the arc at the reference length
//
// Guard bands are one-sided. Conformity is proven if every functional keeps g u from its limit: the
// worst one of a part that does not conform passes with the probability alpha = Q(g) at most, Q the
// upper tail of the normal distribution. Non-conformity is claimed of the largest of many
// functionals, which errors alone make large. It is proven beyond g_n u, with g_n the smaller of
// Bonferroni's Q^-1(alpha / n) for n functionals and Scheffe's sqrt(chi^2_r(1 - alpha)) for r
// dimensions. A form is also reduced by the range that errors make of a perfect feature.
//
//   auto fit = FitCharacteristic(feature, characteristic);
//   auto value = EvaluateMeasured(feature, *fit, deviations_m, {.width_m = 1e-4});
//   if (value.ok() && value->decision == Conformity::kConforms) Accept();
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/conformance/characteristic.h"
#include "core/conformance/conformance.h"
#include "core/conformance/decision.h"
#include "core/conformance/feature.h"

namespace sightline {

enum class Conformity { kConforms, kDoesNotConform, kUndecided };

struct MeasuredZone {
  double width_m = 0;  // > 0; with the bonus of a material requirement; of an angle the arc
  // Limits of a size as the drawing states them. Unset: half the width to either side of the
  // model's.
  std::optional<double> lower_m = std::nullopt, upper_m = std::nullopt;
};

struct MeasuredValue {
  double value_m = 0;
  double uncertainty_m = 0;  // standard uncertainty of the value
  double bias_m = 0;  // of form: range that errors make of a perfect feature; part of the value
  // Holds the true value with a probability of 95.4 % at least.
  Interval interval;
  Conformity decision = Conformity::kUndecided;
  std::string because;  // a sentence that begins with the decision, with figures
  TargetCounts counts;
  int worst_target = -1;  // profiles: index into Feature::targets
  // Profiles: the smallest and the largest deviation, with their signs.
  std::optional<Interval> deviations;
};

// Factors by which uncertainties are expanded (JCGM 100, 6.2) and guard bands are widened.
inline constexpr double kExpansion = 2;

// g_n, see above. `count` >= 1 functionals that span `rank` >= 1 dimensions; guard factor > 0.
double SimultaneousGuardFactor(double guard_factor, int64_t count, int64_t rank);

// `deviations_m`: one per target of the feature [m] along its normal; those of targets that are not
// used are not looked at. Uncertainties of targets, scans and pose are those of the measurement.
// `options`: rule, required share, counts and seed as in JudgeCharacteristic; production is not
// looked at. Too few measured targets leave the decision open unless non-conformity is proven.
//
// INVALID_ARGUMENT: what CheckFeature refuses, a deviation of a used target that is not finite, a
// zone without width. FAILED_PRECONDITION: no target is used.
absl::StatusOr<MeasuredValue> EvaluateMeasured(const Feature& feature, const CharacteristicFit& fit,
                                               const Eigen::VectorXd& deviations_m,
                                               const MeasuredZone& zone,
                                               const ConformanceOptions& options = {});

}  // namespace sightline
