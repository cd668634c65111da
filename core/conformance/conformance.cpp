// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/conformance.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

std::string Length(double m) {
  return std::abs(m) < 1e-4 ? absl::StrFormat("%.3g um", 1e6 * m)
                            : absl::StrFormat("%.3g mm", 1e3 * m);
}
std::string Percent(double share) { return absl::StrFormat("%.3g %%", 100 * share); }

// The part with the largest variance, and its share of the whole.
std::string Dominating(const SurfaceUncertainty& u) {
  const char* name = "detection noise";
  double largest = u.noise_m;
  if (u.sampling_m > largest) name = "sampling", largest = u.sampling_m;
  if (u.calibration_m > largest) name = "calibration", largest = u.calibration_m;
  if (u.registration_m > largest) name = "registration of set-ups", largest = u.registration_m;
  const double share = u.total_m > 0 ? largest * largest / (u.total_m * u.total_m) : 0;
  return absl::StrCat(Percent(share), " of its variance is ", name);
}

// u at which the acceptance zone has exactly the least width that the rule allows; the bias of form
// is proportional to u.
double Admissible(const ToleranceZone& zone, const DecisionRule& rule, double bias_per_u) {
  const double two_sided_m = AdmissibleUncertainty(zone.width_m, rule);
  if (zone.kind == ZoneKind::kTwoSided) return two_sided_m;
  return two_sided_m * 2 * rule.guard_factor / (rule.guard_factor + bias_per_u);
}

}  // namespace

std::optional<ToleranceMeasurand> MeasurandOf(ToleranceKind kind) {
  switch (kind) {
    case ToleranceKind::kFlatness:
    case ToleranceKind::kStraightness:
    case ToleranceKind::kRoundness:
    case ToleranceKind::kCylindricity:
      return ToleranceMeasurand{Measurand::kForm, ZoneKind::kOneSided};
    case ToleranceKind::kSurfaceProfile:
    case ToleranceKind::kLineProfile:
      return ToleranceMeasurand{Measurand::kDeviation, ZoneKind::kTwoSided};
    case ToleranceKind::kPosition:
    case ToleranceKind::kConcentricity:
    case ToleranceKind::kCoaxiality:
    case ToleranceKind::kSymmetry:
      return ToleranceMeasurand{Measurand::kPosition, ZoneKind::kTwoSided};
    case ToleranceKind::kParallelism:
    case ToleranceKind::kPerpendicularity:
    case ToleranceKind::kAngularity:
      return ToleranceMeasurand{Measurand::kOrientation, ZoneKind::kOneSided};
    case ToleranceKind::kLinearSize:
    case ToleranceKind::kLinearDistance:
      return ToleranceMeasurand{Measurand::kSize, ZoneKind::kTwoSided};
    case ToleranceKind::kCircularRunout:
    case ToleranceKind::kTotalRunout:
    case ToleranceKind::kAngularSize:
    case ToleranceKind::kAngularDistance:
      return std::nullopt;
  }
  return std::nullopt;
}

namespace {

absl::Status CheckQuestion(const Feature& feature, const ToleranceZone& zone,
                           const ConformanceOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(CheckDecisionRule(options.rule));
  if (!(options.required_share > 0 && options.required_share <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("required_share is ", options.required_share, ", must be in (0, 1]"));
  }
  if (!(zone.width_m > 0) || !std::isfinite(zone.width_m)) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance zone width_m is ", zone.width_m, ", must be positive and finite"));
  }
  return CheckFeature(feature);
}

// Counts the targets that a tolerance binds. Empty `toleranced`: all of the feature's.
TargetCounts CountTargets(const Feature& feature, const std::vector<int>& toleranced) {
  TargetCounts counts;
  const auto count = [&](const FeatureTarget& target) {
    ++counts.all;
    counts.measured += target.measured;
    counts.used += target.used();
  };
  for (const int t : toleranced) count(feature.targets[static_cast<size_t>(t)]);
  if (toleranced.empty()) std::for_each(feature.targets.begin(), feature.targets.end(), count);
  return counts;
}

// Reason why too few targets are measured or known; empty: there are enough.
std::string TooFew(const TargetCounts& counts, const ConformanceOptions& options) {
  // Rounding must not turn a share of exactly the required one into less.
  const double least = options.required_share * static_cast<double>(counts.all) - 1e-9;
  const auto enough = [&](int64_t count) {
    return count > 0 && static_cast<double>(count) >= least;
  };
  const std::string may = absl::StrCat("; ", Percent(1 - options.required_share), " may be");
  if (!enough(counts.measured)) {
    return absl::StrCat(counts.all - counts.measured, " of its ", counts.all,
                        " targets are not measured", may);
  }
  if (!enough(counts.used)) {
    return absl::StrCat(
        counts.measured - counts.used, " of its ", counts.measured, " measured targets are ",
        options.known_uncertainty_m
            ? absl::StrCat("less certain than ", Length(*options.known_uncertainty_m))
            : "not known well enough",
        may);
  }
  return "";
}

// Profiles: the quantile `required_share` of u over all targets, targets without u coming last, and
// the other values that depend on counts of targets.
void CountDeviations(const MeasurandUncertainty& predicted, double required_share,
                     double admissible_m, FeatureConformance& result) {
  const auto& all = predicted.target_u_m;
  std::vector<int> order(static_cast<size_t>(all.size()));
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return all[a] < all[b]; });
  const Eigen::Index finite = all.array().isFinite().count();
  const auto at = [&](double share, Eigen::Index count) {
    const double rank = std::ceil(share * static_cast<double>(count) - 1e-9) - 1;
    return order[static_cast<size_t>(
        std::clamp(rank, 0.0, static_cast<double>(std::max<Eigen::Index>(1, finite) - 1)))];
  };
  result.percentile_95_u_m = all[at(0.95, finite)];
  result.u = predicted.target_parts[static_cast<size_t>(at(required_share, all.size()))];
  result.admissible_share =
      static_cast<double>((all.array() <= admissible_m).count()) / static_cast<double>(all.size());
}

absl::Status AddProbabilities(const ToleranceZone& zone, const ConformanceOptions& options,
                              FeatureConformance& result) {
  const double g = options.rule.guard_factor;
  const Production production = options.production.value_or(Production::CapableOf(zone));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto without_bias,
                             DecisionProbabilities(zone, result.u.total_m, g, production));
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto with_bias,
      DecisionProbabilities(zone, result.u.total_m, g, production, result.bias_m));
  result.probability_wrong_acceptance = without_bias.wrong_acceptance;
  result.probability_wrong_rejection = with_bias.wrong_rejection;
  return absl::OkStatus();
}

// Decides by the figures and states them in the reason.
void Decide(const ToleranceZone& zone, const ConformanceOptions& options,
            const std::string& too_few, FeatureConformance& result) {
  const double least_m = options.rule.least_acceptance_zone * zone.width_m;
  const bool zone_left = result.acceptance_zone_m > 0 && result.acceptance_zone_m >= least_m;
  const bool accepted = result.acceptance_probability >= kProvableAcceptance;
  result.can_be_proven = too_few.empty() && zone_left && accepted;
  const std::string figures = absl::StrCat(
      "u is ", Length(result.u.total_m), ", ", Dominating(result.u),
      result.bias_m > 0 ? absl::StrCat("; errors alone make a form of ", Length(result.bias_m))
                        : "");
  const std::string limit = absl::StrCat("u must be below ", Length(result.admissible_u_m));
  const std::string good_part = absl::StrCat("a good part is accepted with a probability of ",
                                             Percent(result.acceptance_probability));
  if (!too_few.empty()) {
    result.because = absl::StrCat("cannot be proven: ", too_few);
  } else if (result.acceptance_zone_m <= 0) {
    result.because =
        absl::StrCat("cannot be proven: ", figures, "; no acceptance zone is left of the zone of ",
                     Length(zone.width_m), ", ", limit);
  } else if (!zone_left) {
    result.because =
        absl::StrCat("cannot be proven: the acceptance zone of ", Length(result.acceptance_zone_m),
                     " is below the least one of ", Length(least_m), "; ", figures, "; ", limit);
  } else if (!accepted) {
    result.because =
        absl::StrCat("cannot be proven: ", good_part, ", less than ", Percent(kProvableAcceptance),
                     "; an acceptance zone of ", Length(result.acceptance_zone_m), " is left of ",
                     Length(zone.width_m), "; ", figures, "; ", limit);
  } else {
    result.because = absl::StrCat("can be proven: ", good_part, "; an acceptance zone of ",
                                  Length(result.acceptance_zone_m), " is left of ",
                                  Length(zone.width_m), "; ", figures);
  }
}

// Predicts how often a good part is accepted, and by how much u would have to fall for it.
absl::Status AddAcceptance(const Feature& feature, const CharacteristicFit& fit,
                           const MeasurandUncertainty& predicted, const ToleranceZone& zone,
                           const ConformanceOptions& options, FeatureConformance& result) {
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto acceptance,
      PredictAcceptance(feature, fit, predicted, zone.width_m, options.rule, result.counts,
                        options.required_share, options.seed));
  result.acceptance_probability = acceptance.probability;
  if (std::isfinite(acceptance.median_share) && acceptance.median_share > 0) {
    result.admissible_u_m =
        std::min(result.admissible_u_m, result.u.total_m / acceptance.median_share);
  }
  return absl::OkStatus();
}

// Decides and explains, for both public functions.
absl::StatusOr<FeatureConformance> JudgeFit(const Feature& feature,
                                            const absl::StatusOr<CharacteristicFit>& fit,
                                            const std::vector<int>& toleranced,
                                            const ToleranceZone& zone,
                                            const ConformanceOptions& options) {
  FeatureConformance result;
  const TargetCounts held = CountTargets(feature, toleranced);
  result.counts = options.counts.value_or(held);
  const std::string too_few = TooFew(result.counts, options);
  const auto undetermined = [&](const absl::Status& status) {
    result.because = absl::StrCat("cannot be proven: ",
                                  too_few.empty() ? std::string(status.message()) : too_few);
    return result;
  };
  if (!fit.ok()) {
    if (!absl::IsFailedPrecondition(fit.status())) return fit.status();
    return undetermined(fit.status());
  }
  if (held.used == 0) {
    return undetermined(absl::FailedPreconditionError("no target is known well enough"));
  }
  const Measurand measurand = fit->measurand;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto predicted,
                             PredictUncertainty(feature, fit->fit, measurand, options.seed));

  result.predicted = true;
  result.u = predicted.u;
  result.largest_u_m = result.percentile_95_u_m = predicted.u.total_m;
  result.bias_m = predicted.bias_m;
  if (measurand == Measurand::kDeviation) {
    result.admissible_u_m = Admissible(zone, options.rule, 0);
    CountDeviations(predicted, options.required_share, result.admissible_u_m, result);
  }
  const double bias_per_u = result.u.total_m > 0 ? result.bias_m / result.u.total_m : 0;
  result.admissible_u_m = Admissible(zone, options.rule, bias_per_u);
  result.acceptance_zone_m =
      AcceptanceInterval(zone, result.u.total_m, options.rule.guard_factor).width_m() -
      (zone.kind == ZoneKind::kOneSided ? result.bias_m : 0);
  SIGHTLINE_RETURN_IF_ERROR(AddProbabilities(zone, options, result));
  SIGHTLINE_RETURN_IF_ERROR(AddAcceptance(feature, *fit, predicted, zone, options, result));
  Decide(zone, options, too_few, result);
  if (measurand != Measurand::kDeviation && result.u.total_m <= result.admissible_u_m) {
    result.admissible_share =
        static_cast<double>(result.counts.used) / static_cast<double>(result.counts.all);
  }
  return result;
}

}  // namespace

absl::StatusOr<FeatureConformance> JudgeFeature(const Feature& feature, Measurand measurand,
                                                const ToleranceZone& zone,
                                                const ConformanceOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(CheckQuestion(feature, zone, options));
  auto fit = FitFeature(feature, measurand);
  if (!fit.ok()) return JudgeFit(feature, fit.status(), {}, zone, options);
  CharacteristicFit characteristic;
  characteristic.fit = *std::move(fit);
  characteristic.measurand = measurand;
  characteristic.zone = zone.kind;
  return JudgeFit(feature, characteristic, {}, zone, options);
}

absl::StatusOr<FeatureConformance> JudgeCharacteristic(const Feature& feature,
                                                       const absl::StatusOr<CharacteristicFit>& fit,
                                                       const Characteristic& characteristic,
                                                       double width_m,
                                                       const ConformanceOptions& options) {
  const ZoneKind kind = fit.ok() ? fit->zone : ZoneKind::kTwoSided;
  const ToleranceZone zone{kind, width_m};
  SIGHTLINE_RETURN_IF_ERROR(CheckQuestion(feature, zone, options));
  std::vector<int> toleranced;
  for (const FeatureElement& element : characteristic.elements) {
    toleranced.insert(toleranced.end(), element.targets.begin(), element.targets.end());
  }
  return JudgeFit(feature, fit, toleranced, zone, options);
}

}  // namespace sightline
