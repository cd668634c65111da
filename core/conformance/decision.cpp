// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/decision.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/statistics/normal_distribution.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Normal distribution function of a value with standard deviation s; a step for s = 0.
double NormalBelow(double x, double s) {
  if (s <= 0) return x >= 0 ? 1 : 0;
  return NormalDistribution(x / s);
}

double NormalDensity(double x, double s) {
  const double z = x / s;
  return std::exp(-0.5 * z * z) / (s * std::sqrt(2 * std::numbers::pi));
}

double ProductionDensity(const ToleranceZone& zone, const Production& p, double v) {
  if (zone.kind == ZoneKind::kTwoSided) {
    return NormalDensity(v - p.mean_m, p.standard_deviation_m);
  }
  // Gamma density of shape k and scale theta; mean k theta, variance k theta^2.
  if (v < 0) return 0;
  const double shape = p.mean_m * p.mean_m / (p.standard_deviation_m * p.standard_deviation_m);
  const double scale = p.mean_m / shape;
  if (v == 0) return shape == 1 ? 1 / scale : 0;
  return std::exp((shape - 1) * std::log(v / scale) - v / scale - std::lgamma(shape)) / scale;
}

// Gauss and Legendre's rule of eight points.
constexpr std::array<double, 4> kNodes = {0.1834346424956498, 0.5255324099163290,
                                          0.7966664774136267, 0.9602898564975363};
constexpr std::array<double, 4> kWeights = {0.3626837833783620, 0.3137066458778873,
                                            0.2223810344533745, 0.1012285362903763};

// Integral over [lower, upper], panel by panel between the sorted `breaks` that lie inside.
double Integrate(const std::function<double(double)>& f, double lower, double upper,
                 const std::vector<double>& breaks) {
  double sum = 0, from = lower;
  const auto panel = [&](double to) {
    const double centre = 0.5 * (from + to), half = 0.5 * (to - from);
    double s = 0;
    for (size_t i = 0; i < kNodes.size(); ++i) {
      s += kWeights[i] * (f(centre - half * kNodes[i]) + f(centre + half * kNodes[i]));
    }
    sum += half * s;
    from = to;
  };
  for (const double b : breaks) {
    if (b > from && b < upper) panel(b);
  }
  if (upper > from) panel(upper);
  return sum;
}

// Beyond this many standard deviations a normal density is below 1e-32; a gamma distribution of
// shape >= 1 falls at least like exp(-v / standard deviation).
constexpr double kNormalReach = 12;
constexpr double kGammaReach = 80;

// Ends of what production can be, and places between which the integrand is smooth on the scale of
// a panel: steps of one standard deviation about the centres of each bell or step in it.
struct Panels {
  double lower, upper;
  std::vector<double> breaks;
};

Panels MakePanels(const ToleranceZone& zone, const Production& p,
                  std::initializer_list<double> centres_m, double uncertainty_m) {
  Panels panels;
  const double s = p.standard_deviation_m;
  if (zone.kind == ZoneKind::kTwoSided) {
    panels.lower = p.mean_m - kNormalReach * s;
    panels.upper = p.mean_m + kNormalReach * s;
    for (int i = -12; i <= 12; ++i) panels.breaks.push_back(p.mean_m + i * s);
  } else {
    panels.lower = 0;
    panels.upper = p.mean_m + kGammaReach * s;
    for (int i = -160; i <= 320; ++i) panels.breaks.push_back(p.mean_m + 0.25 * i * s);
    // A shape between 1 and 2 has no derivative at zero: panels that shrink towards it.
    for (int i = 1; i <= 30; ++i) panels.breaks.push_back(p.mean_m * std::exp2(-i));
  }
  for (const double c : centres_m) {
    for (int i = -12; i <= 12; ++i) panels.breaks.push_back(c + i * uncertainty_m);
  }
  std::sort(panels.breaks.begin(), panels.breaks.end());
  return panels;
}

absl::Status OutOfRange(const char* field, double value, const char* allowed) {
  return absl::InvalidArgumentError(absl::StrCat(field, " is ", value, ", must be ", allowed));
}

absl::Status CheckZone(const ToleranceZone& zone) {
  if (!(zone.width_m > 0) || !std::isfinite(zone.width_m)) {
    return OutOfRange("tolerance zone width_m", zone.width_m, "positive and finite");
  }
  return absl::OkStatus();
}

absl::Status CheckProduction(const ToleranceZone& zone, const Production& p) {
  if (!std::isfinite(p.mean_m)) return OutOfRange("production mean_m", p.mean_m, "finite");
  if (!(p.standard_deviation_m > 0) || !std::isfinite(p.standard_deviation_m)) {
    return OutOfRange("production standard_deviation_m", p.standard_deviation_m,
                      "positive and finite");
  }
  // The bound on the shape keeps the density within the panels (shape 1e6: a bell of 0.1 %).
  if (zone.kind == ZoneKind::kOneSided &&
      !(p.standard_deviation_m <= p.mean_m && p.standard_deviation_m >= 1e-3 * p.mean_m)) {
    return OutOfRange("production standard_deviation_m of a one-sided zone", p.standard_deviation_m,
                      absl::StrCat("in [0.001, 1] times its mean_m ", p.mean_m).c_str());
  }
  return absl::OkStatus();
}

}  // namespace

Interval ToleranceInterval(const ToleranceZone& zone) {
  if (zone.kind == ZoneKind::kOneSided) return {0, zone.width_m};
  return {-0.5 * zone.width_m, 0.5 * zone.width_m};
}

Interval AcceptanceInterval(const ToleranceZone& zone, double uncertainty_m, double guard_factor) {
  Interval accepted = ToleranceInterval(zone);
  const double guard_m = guard_factor * uncertainty_m;
  accepted.upper_m -= guard_m;
  if (zone.kind == ZoneKind::kTwoSided) accepted.lower_m += guard_m;
  return accepted;
}

Production Production::CapableOf(const ToleranceZone& zone) {
  if (zone.kind == ZoneKind::kOneSided) return {zone.width_m / 3, zone.width_m / 6};
  return {0, zone.width_m / 6};
}

absl::StatusOr<double> ConformanceProbability(const ToleranceZone& zone, double measured_m,
                                              double uncertainty_m,
                                              const std::optional<Production>& production) {
  SIGHTLINE_RETURN_IF_ERROR(CheckZone(zone));
  if (!std::isfinite(measured_m)) return OutOfRange("measured_m", measured_m, "finite");
  if (!(uncertainty_m > 0) || !std::isfinite(uncertainty_m)) {
    return OutOfRange("uncertainty_m", uncertainty_m, "positive and finite");
  }
  const Interval tolerance = ToleranceInterval(zone);
  if (!production) {
    // The upper limit is the only one of a one-sided quantity; what is below zero is ruled out.
    const double below_upper = NormalBelow(tolerance.upper_m - measured_m, uncertainty_m);
    const double below_lower = NormalBelow(tolerance.lower_m - measured_m, uncertainty_m);
    if (zone.kind == ZoneKind::kTwoSided) return below_upper - below_lower;
    // Below -8 u both ends of the fraction vanish; what is left decays within u from zero.
    const double possible = NormalBelow(measured_m, uncertainty_m);
    if (possible < 1e-15) return 1;
    return std::clamp(1 - NormalBelow(measured_m - tolerance.upper_m, uncertainty_m) / possible, 0.,
                      1.);
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckProduction(zone, *production));
  const Panels panels = MakePanels(
      zone, *production, {measured_m, tolerance.lower_m, tolerance.upper_m}, uncertainty_m);
  // The exponents' largest sum is taken out, so that a value far from production is no 0 / 0.
  double log_scale = -std::numeric_limits<double>::infinity();
  const auto log_joint = [&](double v) {
    const double z = (v - measured_m) / uncertainty_m;
    return -0.5 * z * z + std::log(ProductionDensity(zone, *production, v));
  };
  for (const double b : panels.breaks) {
    if (b > panels.lower && b < panels.upper) log_scale = std::max(log_scale, log_joint(b));
  }
  if (!std::isfinite(log_scale)) {
    return OutOfRange("measured_m", measured_m, "within reach of production");
  }
  const auto joint = [&](double v) { return std::exp(log_joint(v) - log_scale); };
  const double inside = Integrate(joint, std::max(panels.lower, tolerance.lower_m),
                                  std::min(panels.upper, tolerance.upper_m), panels.breaks);
  const double all = Integrate(joint, panels.lower, panels.upper, panels.breaks);
  return std::clamp(inside / all, 0., 1.);
}

absl::StatusOr<GlobalProbabilities> DecisionProbabilities(const ToleranceZone& zone,
                                                          double uncertainty_m, double guard_factor,
                                                          const Production& production,
                                                          double bias_m) {
  SIGHTLINE_RETURN_IF_ERROR(CheckZone(zone));
  SIGHTLINE_RETURN_IF_ERROR(CheckProduction(zone, production));
  if (!(uncertainty_m >= 0) || !std::isfinite(uncertainty_m)) {
    return OutOfRange("uncertainty_m", uncertainty_m, "not negative and finite");
  }
  if (!(guard_factor >= 0) || !std::isfinite(guard_factor)) {
    return OutOfRange("guard_factor", guard_factor, "not negative and finite");
  }
  if (!std::isfinite(bias_m)) return OutOfRange("bias_m", bias_m, "finite");

  const Interval tolerance = ToleranceInterval(zone);
  const Interval accepted = AcceptanceInterval(zone, uncertainty_m, guard_factor);
  const bool one_sided = zone.kind == ZoneKind::kOneSided;
  const auto accept = [&](double v) {
    if (accepted.width_m() <= 0) return 0.0;
    const double y = v + bias_m;
    // Noise may carry an estimate of a one-sided quantity below zero; it is then accepted.
    const double above = one_sided ? 1 : NormalBelow(y - accepted.lower_m, uncertainty_m);
    const double beyond = NormalBelow(y - accepted.upper_m, uncertainty_m);
    return std::max(0.0, above - beyond);
  };
  const auto density = [&](double v) { return ProductionDensity(zone, production, v); };
  const Panels panels = MakePanels(
      zone, production,
      {tolerance.lower_m, tolerance.upper_m, accepted.lower_m - bias_m, accepted.upper_m - bias_m},
      uncertainty_m);
  const auto integrate = [&](const std::function<double(double)>& f, double from, double to) {
    from = std::max(from, panels.lower);
    to = std::min(to, panels.upper);
    return to > from ? Integrate(f, from, to, panels.breaks) : 0;
  };
  const auto accepted_density = [&](double v) { return accept(v) * density(v); };
  const auto rejected_density = [&](double v) { return (1 - accept(v)) * density(v); };
  GlobalProbabilities p;
  p.wrong_acceptance = integrate(accepted_density, tolerance.upper_m, panels.upper);
  if (!one_sided) {
    p.wrong_acceptance += integrate(accepted_density, panels.lower, tolerance.lower_m);
  }
  p.wrong_rejection = integrate(rejected_density, tolerance.lower_m, tolerance.upper_m);
  p.conforming = integrate(density, tolerance.lower_m, tolerance.upper_m);
  p.accepted = p.conforming - p.wrong_rejection + p.wrong_acceptance;
  return p;
}

}  // namespace sightline
