// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/conformance.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

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
  const double share = u.total_m > 0 ? largest * largest / (u.total_m * u.total_m) : 0;
  return absl::StrCat(Percent(share), " of its variance is ", name);
}

// u at which the acceptance zone is exactly what the rule leaves at least; the bias of form grows
// with u.
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

absl::StatusOr<FeatureConformance> JudgeFeature(const Feature& feature, Measurand measurand,
                                                const ToleranceZone& zone,
                                                const ConformanceOptions& options) {
  if (absl::Status s = CheckDecisionRule(options.rule); !s.ok()) return s;
  if (!(options.required_share > 0 && options.required_share <= 1)) {
    return absl::InvalidArgumentError(
        absl::StrCat("required_share is ", options.required_share, ", must be in (0, 1]"));
  }
  if (!(zone.width_m > 0) || !std::isfinite(zone.width_m)) {
    return absl::InvalidArgumentError(
        absl::StrCat("tolerance zone width_m is ", zone.width_m, ", must be positive and finite"));
  }
  if (absl::Status s = CheckFeature(feature); !s.ok()) return s;

  FeatureConformance result;
  const double n = static_cast<double>(feature.targets.size());
  const auto measured = std::count_if(feature.targets.begin(), feature.targets.end(),
                                      [](const FeatureTarget& t) { return t.measured; });
  result.measured_share = static_cast<double>(measured) / n;
  const std::string missing =
      absl::StrFormat("%.3g %% of its %d targets are not measured, %.3g %% may be missing",
                      100 * (1 - result.measured_share), feature.targets.size(),
                      100 * (1 - options.required_share));
  // Rounding must not turn a share of exactly the required one into less.
  const bool enough_measured = result.measured_share >= options.required_share - 1e-12;
  if (measured == 0) {
    result.because = absl::StrCat("cannot be proven: ", missing);
    return result;
  }

  const auto predicted = PredictUncertainty(feature, measurand, options.seed);
  if (!predicted.ok()) {
    if (!absl::IsFailedPrecondition(predicted.status())) return predicted.status();
    result.because = absl::StrCat("cannot be proven: ", predicted.status().message());
    return result;
  }
  result.u = predicted->u;
  result.largest_u_m = result.percentile_95_u_m = predicted->u.total_m;
  result.bias_m = predicted->bias_m;
  if (measurand == Measurand::kDeviation) {
    // Ordered by u, unmeasured targets, which have an infinite one, last.
    std::vector<int> order(feature.targets.size());
    for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
    const auto& all = predicted->target_u_m;
    std::sort(order.begin(), order.end(), [&](int a, int b) { return all[a] < all[b]; });
    const auto at = [&](double share, double count) {
      const double rank = std::ceil(share * count - 1e-9) - 1;
      return order[static_cast<size_t>(std::clamp(rank, 0.0, static_cast<double>(measured - 1)))];
    };
    result.percentile_95_u_m = all[at(0.95, static_cast<double>(measured))];
    const int deciding = at(options.required_share, n);
    const FeatureTarget& t = feature.targets[static_cast<size_t>(deciding)];
    const double independent_m2 = t.uncertainty.noise_m * t.uncertainty.noise_m +
                                  t.uncertainty.sampling_m * t.uncertainty.sampling_m;
    result.u.total_m = all[deciding];
    result.u.noise_m = t.uncertainty.noise_m;
    result.u.sampling_m = t.uncertainty.sampling_m;
    result.u.calibration_m =
        std::sqrt(std::max(0.0, all[deciding] * all[deciding] - independent_m2));
    const double admissible_m = Admissible(zone, options.rule, 0);
    result.admissible_share = static_cast<double>((all.array() <= admissible_m).count()) / n;
  }

  const double g = options.rule.guard_factor;
  result.acceptance_zone_m = AcceptanceInterval(zone, result.u.total_m, g).width_m() -
                             (zone.kind == ZoneKind::kOneSided ? result.bias_m : 0);
  const Production production = options.production.value_or(Production::CapableOf(zone));
  const auto without_bias = DecisionProbabilities(zone, result.u.total_m, g, production);
  if (!without_bias.ok()) return without_bias.status();
  const auto with_bias =
      DecisionProbabilities(zone, result.u.total_m, g, production, result.bias_m);
  if (!with_bias.ok()) return with_bias.status();
  result.probability_wrong_acceptance = without_bias->wrong_acceptance;
  result.probability_wrong_rejection = with_bias->wrong_rejection;

  const double least_m = options.rule.least_acceptance_zone * zone.width_m;
  const bool zone_left = result.acceptance_zone_m > 0 && result.acceptance_zone_m >= least_m;
  if (measurand != Measurand::kDeviation) {
    result.admissible_share = zone_left ? result.measured_share : 0;
  }
  result.can_be_proven = enough_measured && zone_left;
  const std::string uncertainty =
      absl::StrCat("u is ", Length(result.u.total_m), ", ", Dominating(result.u));
  const std::string bias =
      result.bias_m > 0 ? absl::StrCat("; errors alone make a form of ", Length(result.bias_m))
                        : "";
  if (!enough_measured) {
    result.because = absl::StrCat("cannot be proven: ", missing);
  } else if (result.acceptance_zone_m <= 0) {
    result.because = absl::StrCat(
        "cannot be proven: ", uncertainty, bias, "; no acceptance zone is left of the zone of ",
        Length(zone.width_m), ", u must be below ",
        Length(Admissible(zone, options.rule, result.bias_m / result.u.total_m)));
  } else if (!zone_left) {
    result.because =
        absl::StrCat("cannot be proven: the acceptance zone of ", Length(result.acceptance_zone_m),
                     " is below the least one of ", Length(least_m), "; ", uncertainty, bias);
  } else {
    result.because =
        absl::StrCat("can be proven: an acceptance zone of ", Length(result.acceptance_zone_m),
                     " is left of ", Length(zone.width_m), "; ", uncertainty, bias);
  }
  return result;
}

}  // namespace sightline
