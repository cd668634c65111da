// SPDX-License-Identifier: Apache-2.0
// The rule by which a part conforms, does not conform, or is undecided (ISO 14253-1:2017). It
// decides measured values (EvaluateMeasured) and predicts, before anything is measured, how often a
// good part will be accepted (GoodPartAcceptance), so that plan and verdict cannot disagree.
//
// A characteristic is the maximum of amounts x_1 .. x_n, each with a limit L_i and a standard
// uncertainty u_i [m]: deviations of targets (profile), the range of what a fit leaves (form),
// linear functionals of fitted parameters (position, orientation, size).
//
// Conforms: x_i + g u_i <= L_i for every i, an intersection-union test (Berger 1982). A part that
// does not conform passes with the probability alpha = Q(g) at most, whatever n and the
// correlations are, Q the upper tail of the normal distribution.
//
// Does not conform: x_i - b_i > L_i + g_n u_i for any i, b_i the range that errors make of a
// perfect form. The largest of n errors exceeds any one's, hence g_n: the smaller of Bonferroni's
// Q^-1(alpha / n) and Scheffe's sqrt(chi^2_r(1 - alpha)) for functionals of r dimensions.
//
// Targets of profiles whose uncertainty is above a bound cannot keep a guard band. They count as
// not measured, of which a share may be. They still hold acceptance back if they lie beyond a limit
// and noise does not explain it: |x_i| > h_m u_i, at a level of 5 % for all m of them. The bound is
// the least uncertainty that the required share of all targets has, but ProvableUncertainty at
// least and what the rule admits at most. It depends on no measured value. Were it what the rule
// admits in all cases, a further scan could lose a verdict, as it turns targets that count as not
// measured into targets that keep no guard band. Targets less certain than the zone is wide reject
// nothing.
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
  // Limits of a size as the drawing states them. Unset: half the width to either side of the
  // model's.
  std::optional<double> lower_m = std::nullopt, upper_m = std::nullopt;
};

// Toleranced targets: all, measured by any scan, and of these known well enough to be used.
struct TargetCounts {
  int64_t all = 0, measured = 0, used = 0;
};

// An amount that conforms up to a limit [m].
struct BoundedAmount {
  double estimate_m = 0;
  double limit_m = 0;
  double uncertainty_m = 0;
  double bias_m = 0;   // by which errors may have raised it
  int target = -1;     // profiles: index into Feature::targets
  double value_m = 0;  // value of the characteristic if this amount decides it
  double room_m() const { return limit_m - estimate_m; }
};

// The amounts of a characteristic, and what is the same for all of them.
struct Amounts {
  std::vector<BoundedAmount> all;
  double scale = 1;             // of the value to an amount: 2 for profiles and positions
  int64_t count = 1, rank = 1;  // of the functionals behind them, and their dimensions
  double rejecting_factor = 2;  // g_n
  // Uncertainty beyond which an amount counts as not measured, and beyond which it rejects nothing.
  double known_uncertainty_m = std::numeric_limits<double>::infinity();
  double rejecting_uncertainty_m = std::numeric_limits<double>::infinity();

  bool Known(const BoundedAmount& amount) const {
    return amount.uncertainty_m <= known_uncertainty_m;
  }
};

// g_n, see above. `count` >= 1 functionals that span `rank` >= 1 dimensions; guard factor > 0.
double SimultaneousGuardFactor(double guard_factor, int64_t count, int64_t rank);

// Largest standard uncertainty [m] of each of `targets` >= 1 independent deviations at which a good
// part is accepted as often as not: (s/2) / (g + z), z the median of the largest of their errors.
double ProvableUncertainty(double width_m, const DecisionRule& rule, int64_t targets);

// Bound [m] of the standard uncertainty of targets of a profile that count as known, see above.
// `target_u_m`: of every toleranced target, infinite where it is not used; `counts` and
// `required_share` as for DecideConformity.
double KnownBound(const Eigen::VectorXd& target_u_m, double width_m, const DecisionRule& rule,
                  const TargetCounts& counts, double required_share);

// Makes amounts of measured or drawn deviations. Keeps references to its arguments.
class AmountsOfDeviations {
 public:
  AmountsOfDeviations(const CharacteristicFit& fit, const MeasurandUncertainty& uncertainty,
                      const MeasuredZone& zone, const DecisionRule& rule,
                      const TargetCounts& counts, double required_share);
  // `deviations_m`: one for each used target.
  Amounts Of(const Eigen::VectorXd& deviations_m) const;
  // The same of position, orientation and size by the parameters of the fit.
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
  // Index of the amount that the value is taken from: one that is known, or that rejects the part.
  int deciding = -1;
};

// `counts` may be of all targets where the amounts are of every so many. `required_share` of the
// targets must be known for acceptance. At least one amount.
Acceptance DecideConformity(const Amounts& amounts, const DecisionRule& rule,
                            const TargetCounts& counts, double required_share);

// A part without deviations, measured with errors as predicted: 2000 seeded draws of the joint
// errors (JCGM 101), down to 500 for thousands of targets with common errors.
struct GoodPartAcceptance {
  double probability = 0;  // that the rule finds it to conform
  // Median of the share of the zone that the largest amount takes with its guard band. The part is
  // accepted as often as not if all errors are 1 / share times what they are.
  double median_share = 0;
};

// The good part of a size has the middle of its limits. Errors of PredictUncertainty.
absl::StatusOr<GoodPartAcceptance> PredictAcceptance(const Feature& feature,
                                                     const CharacteristicFit& fit,
                                                     const MeasurandUncertainty& uncertainty,
                                                     double width_m, const DecisionRule& rule,
                                                     const TargetCounts& counts,
                                                     double required_share, uint64_t seed);

}  // namespace sightline
