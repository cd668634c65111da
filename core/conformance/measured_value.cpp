// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/measured_value.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::VectorXd;

absl::Status CheckMeasured(const Feature& feature, const CharacteristicFit& fit,
                           const VectorXd& deviations_m, const MeasuredZone& zone,
                           const ConformanceOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(CheckDecisionRule(options.rule));
  SIGHTLINE_RETURN_IF_ERROR(CheckFeature(feature));
  if (!(zone.width_m > 0) || !std::isfinite(zone.width_m)) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance zone width_m is ", zone.width_m, ", must be positive and finite"));
  }
  if (zone.lower_m.has_value() != zone.upper_m.has_value() ||
      (zone.lower_m && !(*zone.lower_m < *zone.upper_m))) {
    return absl::InvalidArgumentError("limits of size must both be given, the lower one smaller");
  }
  if (deviations_m.size() != static_cast<Eigen::Index>(feature.targets.size())) {
    return absl::InvalidArgumentError(
        absl::StrCat(deviations_m.size(), " deviations for ", feature.targets.size(), " targets"));
  }
  for (const int t : fit.fit.used) {
    if (std::isfinite(deviations_m[t])) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("deviation of target ", t, " is ", deviations_m[t], ", must be finite"));
  }
  return absl::OkStatus();
}

TargetCounts CountToleranced(const Feature& feature, const FeatureFit& fit) {
  TargetCounts counts;
  for (const int t : fit.toleranced) {
    const FeatureTarget& target = feature.targets[static_cast<size_t>(t)];
    ++counts.all;
    counts.measured += target.measured;
    counts.used += target.used();
  }
  return counts;
}

// The amounts that the value is made of: the known ones and the deciding one.
bool Counts(const Amounts& amounts, const Acceptance& acceptance, size_t index) {
  return amounts.Known(amounts.all[index]) || static_cast<int>(index) == acceptance.deciding;
}

Interval IntervalOf(const Amounts& amounts, const Acceptance& acceptance, Measurand measurand,
                    const MeasuredValue& value) {
  const double half_m = kExpansion * value.uncertainty_m;
  if (measurand == Measurand::kSize) return {value.value_m - half_m, value.value_m + half_m};
  const double below = SimultaneousGuardFactor(kExpansion, amounts.count, amounts.rank);
  Interval interval;
  for (size_t i = 0; i < amounts.all.size(); ++i) {
    if (!Counts(amounts, acceptance, i)) continue;
    const BoundedAmount& amount = amounts.all[i];
    interval.lower_m = std::max(
        interval.lower_m,
        amounts.scale * (amount.estimate_m - amount.bias_m - below * amount.uncertainty_m));
    interval.upper_m = std::max(
        interval.upper_m, amounts.scale * (amount.estimate_m + kExpansion * amount.uncertainty_m));
  }
  return interval;
}

// Smallest and largest deviation, with signs, of the targets that count.
Interval RangeOf(const Amounts& amounts, const Acceptance& acceptance, const VectorXd& residuals) {
  Interval range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  for (size_t i = 0; i < amounts.all.size(); ++i) {
    if (!Counts(amounts, acceptance, i)) continue;
    const double deviation_m = residuals[static_cast<Eigen::Index>(i)];
    range.lower_m = std::min(range.lower_m, deviation_m);
    range.upper_m = std::max(range.upper_m, deviation_m);
  }
  return range;
}

}  // namespace

absl::StatusOr<MeasuredValue> EvaluateMeasured(const Feature& feature, const CharacteristicFit& fit,
                                               const VectorXd& deviations_m,
                                               const MeasuredZone& zone,
                                               const ConformanceOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(CheckMeasured(feature, fit, deviations_m, zone, options));
  MeasuredValue value;
  const TargetCounts held = CountToleranced(feature, fit.fit);
  value.counts = options.counts.value_or(held);
  if (held.used == 0) return absl::FailedPreconditionError("none of its targets is measured");
  SIGHTLINE_ASSIGN_OR_RETURN(const auto uncertainty,
                             PredictUncertainty(feature, fit.fit, fit.measurand, options.seed));
  VectorXd h(static_cast<Eigen::Index>(fit.fit.used.size()));
  for (Eigen::Index i = 0; i < h.size(); ++i) {
    h[i] = deviations_m[fit.fit.used[static_cast<size_t>(i)]];
  }
  const AmountsOfDeviations amounts_of(fit, uncertainty, zone, options.rule, value.counts,
                                       options.required_share);
  const Amounts amounts = amounts_of.Of(h);
  if (amounts.all.empty()) return absl::FailedPreconditionError("none of its targets is measured");
  const Acceptance acceptance =
      DecideConformity(amounts, options.rule, value.counts, options.required_share);
  const BoundedAmount& deciding = amounts.all[static_cast<size_t>(acceptance.deciding)];
  value.decision = acceptance.decision;
  value.because = acceptance.because;
  value.value_m = deciding.value_m;
  value.uncertainty_m = amounts.scale * deciding.uncertainty_m;
  value.bias_m = deciding.bias_m;
  value.worst_target = deciding.target;
  if (fit.measurand == Measurand::kDeviation) {
    value.deviations = RangeOf(amounts, acceptance, FitResiduals(fit.fit, h));
  }
  value.interval = IntervalOf(amounts, acceptance, fit.measurand, value);
  return value;
}

}  // namespace sightline
