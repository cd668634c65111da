// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/acceptance.h"

#include <Eigen/QR>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Eigen::VectorXd;

// Probability that uncertain targets, all together, prevent the acceptance of a perfect part.
constexpr double kHeldBack = 0.05;
constexpr int64_t kMostDraws = 2000, kFewestDraws = 500;
constexpr int64_t kMostMultiplications = 1'000'000'000;

std::string MicroOrMillimetres(double m) {
  return std::abs(m) < 1e-4 ? absl::StrFormat("%.3g um", 1e6 * m)
                            : absl::StrFormat("%.4g mm", 1e3 * m);
}

std::string PercentText(double share) { return absl::StrFormat("%.3g %%", 100 * share); }

int64_t RankOf(const Eigen::MatrixXd& functionals) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(functionals);
  qr.setThreshold(1e-6);
  return std::max<int64_t>(1, qr.rank());
}

// Reason why too few targets are known for a proof of conformity; empty: enough are known.
std::string TooFewKnown(const Amounts& amounts, const TargetCounts& counts, double required_share) {
  const auto uncertain =
      std::count_if(amounts.all.begin(), amounts.all.end(),
                    [&](const BoundedAmount& amount) { return !amounts.Known(amount); });
  const auto all = static_cast<double>(counts.all);
  const double unused = static_cast<double>(counts.all - counts.used);
  const double known = static_cast<double>(counts.used) *
                       (1 - static_cast<double>(uncertain) /
                                static_cast<double>(std::max<size_t>(1, amounts.all.size())));
  if (known > 0 && known >= required_share * all - 1e-9) return "";
  const std::string may = absl::StrCat("; ", PercentText(1 - required_share), " may be");
  if (all - unused >= required_share * all - 1e-9) {
    return absl::StrFormat("%s of its targets are less certain than %s%s",
                           PercentText((all - known) / all),
                           MicroOrMillimetres(amounts.known_uncertainty_m), may);
  }
  return absl::StrCat(counts.all - counts.used, " of its ", counts.all,
                      " targets are not measured, or not well enough", may);
}

// h_m: the largest of m errors of a perfect surface exceeds it with the probability kHeldBack.
double UnexplainedFactor(const Amounts& amounts) {
  const auto uncertain =
      std::count_if(amounts.all.begin(), amounts.all.end(),
                    [&](const BoundedAmount& amount) { return !amounts.Known(amount); });
  const boost::math::normal_distribution<> normal;
  return quantile(
      complement(normal, kHeldBack / (2 * static_cast<double>(std::max<int64_t>(1, uncertain)))));
}

// Extremes of the amounts that the rule compares with its factors; -1: there is none.
struct Extremes {
  int most_beyond = -1;             // largest x - b - L - g_n u of those that may reject
  int nearest = -1;                 // smallest L - x - g u of those that are known
  int largest = -1;                 // of those that are known, the one with the least room
  int unexplained = -1;             // hardly known, beyond a limit, and more than noise
  double beyond_m = 0, room_m = 0;  // of the first two
};

Extremes ExtremesOf(const Amounts& amounts, double guard_factor) {
  Extremes found;
  const double unexplained = UnexplainedFactor(amounts);
  for (size_t i = 0; i < amounts.all.size(); ++i) {
    const BoundedAmount& amount = amounts.all[i];
    const int index = static_cast<int>(i);
    const double u = amount.uncertainty_m;
    const double beyond_m = -amount.room_m() - amount.bias_m - amounts.rejecting_factor * u;
    if (u <= amounts.rejecting_uncertainty_m &&
        (found.most_beyond < 0 || beyond_m > found.beyond_m)) {
      found.most_beyond = index;
      found.beyond_m = beyond_m;
    }
    if (!amounts.Known(amount)) {
      if (amount.room_m() < 0 && amount.estimate_m > unexplained * u) found.unexplained = index;
      continue;
    }
    const double room_m = amount.room_m() - guard_factor * u;
    if (found.nearest < 0 || room_m < found.room_m) {
      found.nearest = index;
      found.room_m = room_m;
    }
    if (found.largest < 0 ||
        amount.room_m() < amounts.all[static_cast<size_t>(found.largest)].room_m()) {
      found.largest = index;
    }
  }
  return found;
}

// "it exceeds a limit by 60 um, more than the guard band of 20 um (3.1 u)"
std::string Comparison(const Amounts& amounts, const BoundedAmount& amount, double factor,
                       double bias_m, const char* compared) {
  const std::string apart = MicroOrMillimetres(amounts.scale * std::abs(amount.room_m()));
  return absl::StrFormat(
      "it %s, %s than the guard band of %s (%.3g u)",
      amount.room_m() < 0 ? absl::StrCat("exceeds a limit by ", apart)
                          : absl::StrCat("keeps ", apart, " from a limit"),
      compared, MicroOrMillimetres(amounts.scale * (bias_m + factor * amount.uncertainty_m)),
      factor);
}

// Fraction of the zone that the largest known amount takes with its guard band; accepted up to 1.
double TakenShare(const Amounts& amounts, double guard_factor) {
  double share = 0;
  for (const BoundedAmount& amount : amounts.all) {
    if (!amounts.Known(amount)) continue;
    share =
        std::max(share, (amount.estimate_m + guard_factor * amount.uncertainty_m) / amount.limit_m);
  }
  return share;
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

double ProvableUncertainty(double width_m, const DecisionRule& rule, int64_t targets) {
  // The largest of n absolute errors is below z with the probability (2 Phi(z) - 1)^n.
  const double beyond = -std::expm1(std::log(0.5) / static_cast<double>(targets));
  const boost::math::normal_distribution<> normal;
  const double z = quantile(complement(normal, 0.5 * beyond));
  return std::min(AdmissibleUncertainty(width_m, rule), 0.5 * width_m / (rule.guard_factor + z));
}

double KnownBound(const VectorXd& target_u_m, double width_m, const DecisionRule& rule,
                  const TargetCounts& counts, double required_share) {
  std::vector<double> used;
  for (const double u : target_u_m) {
    if (std::isfinite(u)) used.push_back(u);
  }
  const double admissible_m = AdmissibleUncertainty(width_m, rule);
  if (used.empty() || counts.used <= 0) return admissible_m;
  std::sort(used.begin(), used.end());
  // Number of `used` targets that makes the required fraction of all targets.
  const auto n = static_cast<double>(used.size());
  const auto required = static_cast<int64_t>(std::ceil(
      required_share * n * static_cast<double>(counts.all) / static_cast<double>(counts.used) -
      1e-9));
  if (required > std::ssize(used)) return admissible_m;
  const double share_m = used[static_cast<size_t>(std::max<int64_t>(1, required) - 1)];
  const double provable_m = ProvableUncertainty(width_m, rule, std::ssize(used));
  return std::min(admissible_m, std::max(provable_m, share_m));
}

AmountsOfDeviations::AmountsOfDeviations(const CharacteristicFit& fit,
                                         const MeasurandUncertainty& uncertainty,
                                         const MeasuredZone& zone, const DecisionRule& rule,
                                         const TargetCounts& counts, double required_share)
    : fit_(fit), uncertainty_(uncertainty), zone_(zone) {
  if (fit.measurand == Measurand::kDeviation) {
    known_uncertainty_m_ =
        KnownBound(uncertainty.target_u_m, zone.width_m, rule, counts, required_share);
    const int64_t known = uncertainty.target_u_m.array().isFinite().count();
    count_ = rank_ = std::max<int64_t>(1, known);
  } else if (fit.measurand != Measurand::kForm) {
    count_ = fit.fit.functionals.rows();
    rank_ = RankOf(fit.fit.functionals);
  }
  rejecting_factor_ = SimultaneousGuardFactor(rule.guard_factor, count_, rank_);
}

Amounts AmountsOfDeviations::Of(const VectorXd& h) const {
  Amounts amounts;
  amounts.count = count_;
  amounts.rank = rank_;
  amounts.rejecting_factor = rejecting_factor_;
  if (fit_.measurand == Measurand::kDeviation) {
    amounts.scale = 2;
    amounts.known_uncertainty_m = known_uncertainty_m_;
    amounts.rejecting_uncertainty_m = zone_.width_m;
    const VectorXd residuals = FitResiduals(fit_.fit, h);
    Eigen::Index row = 0;
    for (size_t i = 0; i < fit_.fit.toleranced.size() && row < residuals.size(); ++i) {
      const double own_u = uncertainty_.target_u_m[static_cast<Eigen::Index>(i)];
      if (!std::isfinite(own_u)) continue;
      const double amount_m = std::abs(residuals[row++]);
      amounts.all.push_back({amount_m, 0.5 * zone_.width_m, own_u, 0, fit_.fit.toleranced[i],
                             amounts.scale * amount_m});
    }
    return amounts;
  }
  if (fit_.measurand == Measurand::kForm) {
    const double range_m = FormDeviation(fit_.fit, h);
    amounts.all = {
        {range_m, zone_.width_m, uncertainty_.u.total_m, uncertainty_.bias_m, -1, range_m}};
    return amounts;
  }
  return OfParameters(fit_.fit.estimator * h);
}

Amounts AmountsOfDeviations::OfParameters(const VectorXd& parameters_m) const {
  Amounts amounts;
  amounts.count = count_;
  amounts.rank = rank_;
  amounts.rejecting_factor = rejecting_factor_;
  // The largest uncertainty of the functionals stands for all: they differ little.
  const double u = uncertainty_.u.total_m;
  const VectorXd changes = fit_.fit.functionals * parameters_m;
  if (fit_.measurand == Measurand::kSize) {
    for (Eigen::Index k = 0; k < changes.size(); ++k) {
      const double model_m =
          fit_.model_sizes_m.empty() ? 0 : fit_.model_sizes_m[static_cast<size_t>(k)];
      const double size_m = model_m + changes[k];
      const double lower_m = zone_.lower_m.value_or(model_m - 0.5 * zone_.width_m);
      const double upper_m = zone_.upper_m.value_or(model_m + 0.5 * zone_.width_m);
      amounts.all.push_back({size_m, upper_m, u, 0, -1, size_m});
      amounts.all.push_back({-size_m, -lower_m, u, 0, -1, size_m});
    }
    return amounts;
  }
  amounts.scale = fit_.measurand == Measurand::kPosition ? 2 : 1;
  for (const double change : changes) {
    // Under a material requirement the room that the size gives may exceed the displacement.
    amounts.all.push_back(
        {change, zone_.width_m / amounts.scale, u, 0, -1, amounts.scale * std::max(0.0, change)});
  }
  return amounts;
}

Acceptance DecideConformity(const Amounts& amounts, const DecisionRule& rule,
                            const TargetCounts& counts, double required_share) {
  const double g = rule.guard_factor;
  const Extremes extremes = ExtremesOf(amounts, g);
  const auto at = [&](int index) -> const BoundedAmount& {
    return amounts.all[static_cast<size_t>(index)];
  };
  Acceptance acceptance;
  acceptance.deciding = extremes.largest;
  if (extremes.most_beyond >= 0 && extremes.beyond_m > 0) {
    const BoundedAmount& beyond = at(extremes.most_beyond);
    acceptance.decision = Conformity::kDoesNotConform;
    acceptance.because =
        absl::StrCat("does not conform: ",
                     Comparison(amounts, beyond, amounts.rejecting_factor, beyond.bias_m, "more"));
    if (extremes.largest < 0 || beyond.room_m() < at(extremes.largest).room_m()) {
      acceptance.deciding = extremes.most_beyond;
    }
    return acceptance;
  }
  const std::string too_few = TooFewKnown(amounts, counts, required_share);
  if (extremes.largest >= 0 && at(extremes.largest).room_m() < 0) {
    const BoundedAmount& outside = at(extremes.largest);
    acceptance.because = absl::StrCat(
        "undecided: ",
        Comparison(amounts, outside, amounts.rejecting_factor, outside.bias_m, "less"));
  } else if (extremes.unexplained >= 0) {
    const BoundedAmount& doubtful = at(extremes.unexplained);
    acceptance.because = absl::StrFormat(
        "undecided: a target that is known to %s only lies %s beyond a limit, which noise does not "
        "explain",
        MicroOrMillimetres(doubtful.uncertainty_m), MicroOrMillimetres(-doubtful.room_m()));
  } else if (!too_few.empty()) {
    acceptance.because = absl::StrCat("undecided: ", too_few);
  } else if (extremes.room_m < 0) {
    acceptance.because =
        absl::StrCat("undecided: ", Comparison(amounts, at(extremes.nearest), g, 0, "less"));
  } else {
    acceptance.decision = Conformity::kConforms;
    acceptance.because =
        absl::StrCat("conforms: ", Comparison(amounts, at(extremes.nearest), g, 0, "more"));
  }
  if (acceptance.deciding >= 0) return acceptance;
  // No amount is certain enough: the value is that of the least uncertain amount.
  const auto least = std::min_element(
      amounts.all.begin(), amounts.all.end(),
      [](const auto& a, const auto& b) { return a.uncertainty_m < b.uncertainty_m; });
  acceptance.deciding = static_cast<int>(least - amounts.all.begin());
  return acceptance;
}

absl::StatusOr<GoodPartAcceptance> PredictAcceptance(const Feature& feature,
                                                     const CharacteristicFit& fit,
                                                     const MeasurandUncertainty& uncertainty,
                                                     double width_m, const DecisionRule& rule,
                                                     const TargetCounts& counts,
                                                     double required_share, uint64_t seed) {
  const bool fitted = fit.measurand != Measurand::kDeviation && fit.measurand != Measurand::kForm;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto errors, fitted
                                                    ? ErrorDraws::OfParameters(feature, fit.fit)
                                                    : ErrorDraws::OfDeviations(feature, fit.fit));
  // Sizes are changes from that of the middle of their limits.
  CharacteristicFit changes = fit;
  changes.model_sizes_m.clear();
  const AmountsOfDeviations amounts_of(changes, uncertainty, {.width_m = width_m}, rule, counts,
                                       required_share);
  const int64_t draws = std::clamp(kMostMultiplications / std::max<int64_t>(1, errors.Cost()),
                                   kFewestDraws, kMostDraws);
  std::vector<double> shares;
  int64_t accepted = 0;
  for (int64_t d = 0; d < draws; ++d) {
    const VectorXd drawn = errors.Draw(seed, static_cast<uint64_t>(d));
    const Amounts amounts = fitted ? amounts_of.OfParameters(drawn) : amounts_of.Of(drawn);
    if (amounts.all.empty()) return GoodPartAcceptance{};
    const Extremes extremes = ExtremesOf(amounts, rule.guard_factor);
    if (d == 0 && !TooFewKnown(amounts, counts, required_share).empty()) {
      return GoodPartAcceptance{0, std::numeric_limits<double>::infinity()};
    }
    const bool rejected = extremes.beyond_m > 0;
    accepted += !rejected && extremes.unexplained < 0 && extremes.room_m >= 0;
    shares.push_back(TakenShare(amounts, rule.guard_factor));
  }
  const auto middle = shares.begin() + static_cast<std::ptrdiff_t>((shares.size() - 1) / 2);
  std::nth_element(shares.begin(), middle, shares.end());
  return GoodPartAcceptance{static_cast<double>(accepted) / static_cast<double>(draws), *middle};
}

}  // namespace sightline
