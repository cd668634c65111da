// SPDX-License-Identifier: Apache-2.0
// The decision rule: a part conforms, does not conform, or is undecided (ISO 14253-1:2017). One
// rule decides measured values (EvaluateMeasured) and predicts, before the measurement, how often a
// good part will be accepted (GoodPartAcceptance), so that plan and verdict agree.
//
// A characteristic is the maximum of amounts x_1 .. x_n, each with a limit L_i and a standard
// uncertainty u_i [m]: deviations of targets (profile), the range of what a fit leaves (form),
// linear functionals of fitted parameters (position, orientation, size).
//
// Conforms: x_i + g u_i <= L_i for every i, an intersection-union test (Berger 1982). A part that
// does not conform passes with a probability of at most alpha = Q(g) for any n and any
// correlations, with Q the upper tail of the normal distribution.
//
// Does not conform: x_i - b_i > L_i + g_n u_i for any i, with b_i the range that errors cause on a
// perfect form. The factor g_n allows for the largest of n errors: the smaller of Bonferroni's
// Q^-1(alpha / n) and Scheffe's sqrt(chi^2_r(1 - alpha)) for functionals of r dimensions.
//
// Targets of profiles whose uncertainty is above a bound cannot keep a guard band. They count as
// not measured, which a fraction of the targets may be. They still prevent acceptance if they lie
// beyond a limit and noise does not explain that: |x_i| > h_m u_i, at a level of 5 % for all m of
// them. The bound is the least uncertainty that the required fraction of all targets has, but at
// least ProvableUncertainty and at most the uncertainty that the rule admits. It does not depend on
// measured values. If it were always the admitted uncertainty, a further scan could lose a verdict,
// by turning targets that count as not measured into targets that keep no guard band. Targets whose
// uncertainty exceeds the zone's width never reject the part.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/conformance/characteristic.h"
#include "core/conformance/feature.h"
#include "core/tolerance/tolerance.h"

namespace sightline {

enum class Conformity { kConforms, kDoesNotConform, kUndecided };

struct MeasuredZone {
  double width_m = 0;  // > 0; with the bonus of a material requirement; of an angle the arc
  // Limits of a size on the drawing. Unset: half the width to either side of the model's size.
  std::optional<double> lower_m = std::nullopt, upper_m = std::nullopt;
};

// Numbers of toleranced targets: all; measured by a scan; certain enough to be used.
struct TargetCounts {
  int64_t all = 0, measured = 0, used = 0;
};

// An amount that conforms up to a limit [m].
struct BoundedAmount {
  double estimate_m = 0;
  double limit_m = 0;
  double uncertainty_m = 0;
  double bias_m = 0;   // amount by which errors may have raised it
  int target = -1;     // profiles: index into Feature::targets
  double value_m = 0;  // value of the characteristic if this amount decides it
  double room_m() const { return limit_m - estimate_m; }
};

// The amounts of a characteristic, and values that all of them share.
struct Amounts {
  std::vector<BoundedAmount> all;
  double scale = 1;             // value over amount: 2 for profiles and positions
  int64_t count = 1, rank = 1;  // of the functionals behind them, and their dimensions
  double rejecting_factor = 2;  // g_n
  // Uncertainties above which an amount counts as not measured, and above which it never rejects.
  double known_uncertainty_m = std::numeric_limits<double>::infinity();
  double rejecting_uncertainty_m = std::numeric_limits<double>::infinity();

  bool Known(const BoundedAmount& amount) const {
    return amount.uncertainty_m <= known_uncertainty_m;
  }
};

// g_n, see above. `count` >= 1 functionals that span `rank` >= 1 dimensions; guard factor > 0.
double SimultaneousGuardFactor(double guard_factor, int64_t count, int64_t rank);

// Largest standard uncertainty [m] of each of `targets` >= 1 independent deviations at which a good
// part is accepted with probability 1/2: (s/2) / (g + z), z the median of the largest |error| / u.
double ProvableUncertainty(double width_m, const DecisionRule& rule, int64_t targets);

// Bound [m] on the standard uncertainty of targets of a profile that count as measured, see above.
// `target_u_m`: uncertainty of every toleranced target, infinite if it is not used; `counts` and
// `required_share` as for DecideConformity.
double KnownBound(const Eigen::VectorXd& target_u_m, double width_m, const DecisionRule& rule,
                  const TargetCounts& counts, double required_share);

// Makes amounts from measured or simulated deviations. Keeps references to its arguments.
class AmountsOfDeviations {
 public:
  AmountsOfDeviations(const CharacteristicFit& fit, const MeasurandUncertainty& uncertainty,
                      const MeasuredZone& zone, const DecisionRule& rule,
                      const TargetCounts& counts, double required_share);
  // `deviations_m`: one for each used target.
  Amounts Of(const Eigen::VectorXd& deviations_m) const;
  // The same for position, orientation and size, from the parameters of the fit.
  Amounts OfParameters(const Eigen::VectorXd& parameters_m) const;

 private:
  const CharacteristicFit& fit_;
  const MeasurandUncertainty& uncertainty_;
  MeasuredZone zone_;
  int64_t count_ = 1, rank_ = 1;
  double known_uncertainty_m_ = std::numeric_limits<double>::infinity();
  double rejecting_factor_ = 2;
};

struct Acceptance {
  Conformity decision = Conformity::kUndecided;
  std::string because;  // a sentence that begins with the decision, with figures
  // Index of the amount that gives the value: a known one, or one that rejects the part.
  int deciding = -1;
};

// `counts` may count all targets while the amounts are those of a subset. For acceptance the
// fraction `required_share` of the targets must be known. Needs at least one amount.
Acceptance DecideConformity(const Amounts& amounts, const DecisionRule& rule,
                            const TargetCounts& counts, double required_share);

// Acceptance of a part without deviations, measured with the predicted errors: Monte Carlo with
// 2000 seeded draws of the joint errors (JCGM 101), down to 500 for thousands of targets with
// common errors.
struct GoodPartAcceptance {
  double probability = 0;  // probability that the rule decides "conforms"
  // Median of the fraction of the zone that the largest amount takes with its guard band. With all
  // errors multiplied by 1 / median_share the part would be accepted with probability 1/2.
  double median_share = 0;
};

// For a size, the good part lies in the middle of the limits. Errors as PredictUncertainty.
absl::StatusOr<GoodPartAcceptance> PredictAcceptance(const Feature& feature,
                                                     const CharacteristicFit& fit,
                                                     const MeasurandUncertainty& uncertainty,
                                                     double width_m, const DecisionRule& rule,
                                                     const TargetCounts& counts,
                                                     double required_share, uint64_t seed);

}  // namespace sightline
