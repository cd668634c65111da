// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/measured_value.h"

#include <Eigen/QR>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace sightline {
namespace {

using Eigen::VectorXd;

// An amount that conforms up to a limit.
struct BoundedAmount {
  double estimate_m = 0;
  double limit_m = 0;
  double uncertainty_m = 0;
  double bias_m = 0;  // by which errors may have raised it
  double room_m() const { return limit_m - estimate_m; }
};

// The functionals of a characteristic, each with its limit.
struct Amounts {
  std::vector<BoundedAmount> all;
  int64_t count = 1, rank = 1;  // of the functionals behind them
  double scale = 1;             // of the value to an amount: 2 for profiles and positions
  double known_uncertainty_m = std::numeric_limits<double>::infinity();
};

std::string LengthText(double m) {
  return std::abs(m) < 1e-4 ? absl::StrFormat("%.3g um", 1e6 * m)
                            : absl::StrFormat("%.4g mm", 1e3 * m);
}

std::string ShareText(double share) { return absl::StrFormat("%.3g %%", 100 * share); }

absl::Status CheckMeasured(const Feature& feature, const CharacteristicFit& fit,
                           const VectorXd& deviations_m, const MeasuredZone& zone,
                           const ConformanceOptions& options) {
  if (absl::Status s = CheckDecisionRule(options.rule); !s.ok()) return s;
  if (absl::Status s = CheckFeature(feature); !s.ok()) return s;
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

int64_t RankOf(const Eigen::MatrixXd& functionals) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(functionals);
  qr.setThreshold(1e-6);
  return std::max<int64_t>(1, qr.rank());
}

// The deviation of every used target, and what only profiles have.
Amounts ProfileAmounts(const FeatureFit& fit, const VectorXd& h,
                       const MeasurandUncertainty& uncertainty, const MeasuredZone& zone,
                       const DecisionRule& rule, MeasuredValue& value) {
  const VectorXd residuals = FitResiduals(fit, h);
  Amounts amounts;
  amounts.scale = 2;
  amounts.known_uncertainty_m = AdmissibleUncertainty(zone.width_m, rule);
  Interval& range = value.deviations.emplace();
  range.lower_m = residuals.minCoeff();
  range.upper_m = residuals.maxCoeff();
  double largest_m = -1;
  Eigen::Index row = 0;
  for (size_t i = 0; i < fit.toleranced.size() && row < residuals.size(); ++i) {
    const double u = uncertainty.target_u_m[static_cast<Eigen::Index>(i)];
    if (!std::isfinite(u)) continue;
    const double amount_m = std::abs(residuals[row++]);
    amounts.all.push_back({amount_m, 0.5 * zone.width_m, u, 0});
    if (amount_m <= largest_m) continue;
    largest_m = amount_m;
    value.uncertainty_m = 2 * u;
    value.worst_target = fit.toleranced[i];
  }
  value.value_m = 2 * largest_m;
  amounts.count = std::max<int64_t>(1, static_cast<int64_t>(amounts.all.size()));
  amounts.rank = amounts.count;
  return amounts;
}

Amounts FormAmounts(const FeatureFit& fit, const VectorXd& h,
                    const MeasurandUncertainty& uncertainty, const MeasuredZone& zone,
                    MeasuredValue& value) {
  value.value_m = FormDeviation(fit, h);
  value.uncertainty_m = uncertainty.u.total_m;
  value.bias_m = uncertainty.bias_m;
  Amounts amounts;
  amounts.all = {{value.value_m, zone.width_m, value.uncertainty_m, value.bias_m}};
  return amounts;
}

// Functionals of the largest uncertainty stand for all: they differ little.
Amounts FunctionalAmounts(const CharacteristicFit& fit, const VectorXd& h,
                          const MeasurandUncertainty& uncertainty, const MeasuredZone& zone,
                          MeasuredValue& value) {
  const VectorXd changes = fit.fit.functionals * (fit.fit.estimator * h);
  const double u = uncertainty.u.total_m;
  Amounts amounts;
  amounts.count = changes.size();
  amounts.rank = RankOf(fit.fit.functionals);
  if (fit.measurand != Measurand::kSize) {
    const bool position = fit.measurand == Measurand::kPosition;
    amounts.scale = position ? 2 : 1;
    for (const double change : changes) {
      amounts.all.push_back({change, zone.width_m / amounts.scale, u, 0});
    }
    // Under a material requirement the room that the size gives may exceed the displacement.
    value.value_m = amounts.scale * std::max(0.0, changes.maxCoeff());
    value.uncertainty_m = amounts.scale * u;
    return amounts;
  }
  double least_room_m = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < changes.size(); ++k) {
    const double model_m =
        fit.model_sizes_m.empty() ? 0 : fit.model_sizes_m[static_cast<size_t>(k)];
    const double size_m = model_m + changes[k];
    const double lower_m = zone.lower_m.value_or(model_m - 0.5 * zone.width_m);
    const double upper_m = zone.upper_m.value_or(model_m + 0.5 * zone.width_m);
    amounts.all.push_back({size_m, upper_m, u, 0});
    amounts.all.push_back({-size_m, -lower_m, u, 0});
    const double room_m = std::min(upper_m - size_m, size_m - lower_m);
    if (room_m >= least_room_m) continue;
    least_room_m = room_m;
    value.value_m = size_m;
  }
  value.uncertainty_m = u;
  return amounts;
}

Interval IntervalOf(const Amounts& amounts, Measurand measurand, const MeasuredValue& value) {
  const double half_m = kExpansion * value.uncertainty_m;
  if (measurand == Measurand::kSize) return {value.value_m - half_m, value.value_m + half_m};
  const double below = SimultaneousGuardFactor(kExpansion, amounts.count, amounts.rank);
  Interval interval;
  for (const BoundedAmount& amount : amounts.all) {
    interval.lower_m = std::max(
        interval.lower_m,
        amounts.scale * (amount.estimate_m - amount.bias_m - below * amount.uncertainty_m));
    interval.upper_m = std::max(
        interval.upper_m, amounts.scale * (amount.estimate_m + kExpansion * amount.uncertainty_m));
  }
  return interval;
}

// Why too few targets are known for a proof of conformity; empty: enough are.
std::string TooFewKnown(const Amounts& amounts, const TargetCounts& counts, double required_share) {
  int64_t uncertain = 0;
  for (const BoundedAmount& amount : amounts.all) {
    uncertain += amount.uncertainty_m > amounts.known_uncertainty_m;
  }
  // Counts may be of all targets where the amounts are of every so many.
  const auto all = static_cast<double>(counts.all);
  const double unused = static_cast<double>(counts.all - counts.used);
  const double known = static_cast<double>(counts.used) *
                       (1 - static_cast<double>(uncertain) /
                                static_cast<double>(std::max<size_t>(1, amounts.all.size())));
  if (known >= required_share * all - 1e-9) return "";
  const std::string may = absl::StrCat("; ", ShareText(1 - required_share), " may be");
  if (all - unused >= required_share * all - 1e-9) {
    return absl::StrFormat("%s of its targets are less certain than %s%s",
                           ShareText((all - known) / all), LengthText(amounts.known_uncertainty_m),
                           may);
  }
  return absl::StrCat(counts.all - counts.used, " of its ", counts.all,
                      " targets are not measured, or not well enough", may);
}

void DecideConformity(const Amounts& amounts, const ConformanceOptions& options,
                      MeasuredValue& value) {
  const double g = options.rule.guard_factor;
  const double rejecting = SimultaneousGuardFactor(g, amounts.count, amounts.rank);
  double most_beyond_m = -1, least_room_m = std::numeric_limits<double>::infinity();
  const BoundedAmount *beyond = nullptr, *nearest = nullptr;
  bool outside = false, guarded = false;
  for (const BoundedAmount& amount : amounts.all) {
    const bool known = amount.uncertainty_m <= amounts.known_uncertainty_m;
    outside = outside || amount.room_m() < 0;
    guarded = guarded || (known && amount.room_m() < g * amount.uncertainty_m);
    const double proven_m = -amount.room_m() - amount.bias_m - rejecting * amount.uncertainty_m;
    if (proven_m > most_beyond_m) most_beyond_m = proven_m, beyond = &amount;
    const double room_m = amount.room_m() - g * amount.uncertainty_m;
    if ((known || amount.room_m() < 0) && room_m < least_room_m) {
      least_room_m = room_m;
      nearest = &amount;
    }
  }
  const std::string too_few = TooFewKnown(amounts, value.counts, options.required_share);
  const auto band = [&](double factor, const BoundedAmount& amount) {
    return LengthText(amounts.scale * (factor * amount.uncertainty_m));
  };
  if (beyond != nullptr && most_beyond_m > 0) {
    value.decision = Conformity::kDoesNotConform;
    value.because = absl::StrFormat(
        "does not conform: it exceeds a limit by %s, more than the guard band of %s (%.3g u)",
        LengthText(-amounts.scale * beyond->room_m()),
        LengthText(amounts.scale * (beyond->bias_m + rejecting * beyond->uncertainty_m)),
        rejecting);
  } else if (outside) {
    value.decision = Conformity::kUndecided;
    value.because = absl::StrFormat(
        "undecided: it exceeds a limit by %s, less than the guard band of %s (%.3g u)",
        LengthText(-amounts.scale * nearest->room_m()),
        LengthText(amounts.scale * (nearest->bias_m + rejecting * nearest->uncertainty_m)),
        rejecting);
  } else if (!too_few.empty()) {
    value.decision = Conformity::kUndecided;
    value.because = absl::StrCat("undecided: ", too_few);
  } else if (guarded || nearest == nullptr) {
    value.decision = Conformity::kUndecided;
    value.because =
        nearest == nullptr
            ? "undecided: nothing is known well enough"
            : absl::StrFormat(
                  "undecided: it keeps %s from a limit, less than the guard band of %s (%.3g u)",
                  LengthText(amounts.scale * nearest->room_m()), band(g, *nearest), g);
  } else {
    value.decision = Conformity::kConforms;
    value.because = absl::StrFormat(
        "conforms: it keeps %s from a limit, more than the guard band of %s (%.3g u)",
        LengthText(amounts.scale * nearest->room_m()), band(g, *nearest), g);
  }
}

}  // namespace

double SimultaneousGuardFactor(double guard_factor, int64_t count, int64_t rank) {
  if (count <= 1) return guard_factor;
  const boost::math::normal_distribution<> normal;
  const double alpha = cdf(complement(normal, guard_factor));
  const double bonferroni =
      quantile(complement(normal, alpha / static_cast<double>(std::max<int64_t>(1, count))));
  const boost::math::chi_squared_distribution<> squares(static_cast<double>(rank));
  return std::min(bonferroni, std::sqrt(quantile(complement(squares, alpha))));
}

absl::StatusOr<MeasuredValue> EvaluateMeasured(const Feature& feature, const CharacteristicFit& fit,
                                               const VectorXd& deviations_m,
                                               const MeasuredZone& zone,
                                               const ConformanceOptions& options) {
  if (absl::Status s = CheckMeasured(feature, fit, deviations_m, zone, options); !s.ok()) return s;
  MeasuredValue value;
  const TargetCounts held = CountToleranced(feature, fit.fit);
  value.counts = options.counts.value_or(held);
  if (held.used == 0) return absl::FailedPreconditionError("none of its targets is measured");
  const auto uncertainty = PredictUncertainty(feature, fit.fit, fit.measurand, options.seed);
  if (!uncertainty.ok()) return uncertainty.status();
  VectorXd h(static_cast<Eigen::Index>(fit.fit.used.size()));
  for (Eigen::Index i = 0; i < h.size(); ++i) {
    h[i] = deviations_m[fit.fit.used[static_cast<size_t>(i)]];
  }
  Amounts amounts;
  switch (fit.measurand) {
    case Measurand::kDeviation:
      amounts = ProfileAmounts(fit.fit, h, *uncertainty, zone, options.rule, value);
      break;
    case Measurand::kForm:
      amounts = FormAmounts(fit.fit, h, *uncertainty, zone, value);
      break;
    case Measurand::kPosition:
    case Measurand::kOrientation:
    case Measurand::kSize:
      amounts = FunctionalAmounts(fit, h, *uncertainty, zone, value);
      break;
  }
  value.interval = IntervalOf(amounts, fit.measurand, value);
  DecideConformity(amounts, options, value);
  return value;
}

}  // namespace sightline
