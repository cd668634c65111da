// SPDX-License-Identifier: Apache-2.0
// Decision on conformance with a tolerance by an uncertain measurement: acceptance zone and
// probabilities of wrong decisions (ISO 14253-1:2017; JCGM 106:2012, clauses 7 to 9).
//
// Conventions. A two-sided zone of full width s_t lies symmetrically about the nominal value:
// deviations in [-s_t/2, s_t/2] conform. A one-sided zone belongs to quantities that cannot be
// negative, such as flatness: values in [0, s_t] conform. Zero cannot be violated, so that there
// is a guard band only at s_t.
#pragma once

#include <optional>

#include "absl/status/statusor.h"

namespace sightline {

enum class ZoneKind { kTwoSided, kOneSided };

struct ToleranceZone {
  ZoneKind kind = ZoneKind::kTwoSided;
  double width_m = 1e-4;  // s_t > 0
};

struct Interval {
  double lower_m = 0;
  double upper_m = 0;  // below lower_m: the interval is empty
  double width_m() const { return upper_m - lower_m; }
};

Interval ToleranceInterval(const ToleranceZone& zone);

// Measured values that prove conformance: the tolerance interval without a guard band of g u at
// every limit that can be violated. Width s_t - 2 g u (two-sided) or s_t - g u (one-sided);
// negative: nothing can be proven. Standard uncertainty u >= 0, guard factor g >= 0.
// ISO 14253-1:2017 sets g = 1.65 by default (95 % probability of conformance at the edge of the
// acceptance zone, u small against s_t); g = 2 is the choice of thesis section 3.3.
Interval AcceptanceInterval(const ToleranceZone& zone, double uncertainty_m, double guard_factor);

// Prior distribution of parts before they are measured. Two-sided zones: normal distribution of the
// deviation. One-sided zones: gamma distribution of that mean and standard deviation, as in the
// example of ball bearings of JCGM 106 (9.5.4).
struct Production {
  double mean_m = 0;
  double standard_deviation_m = 1;  // > 0; one-sided: 0 < standard deviation <= mean

  // A process of capability C_p = 1: two-sided N(0, s_t/6), 0.27 % of the parts do not conform;
  // one-sided a gamma distribution of mean s_t/3 and standard deviation s_t/6 (shape 4), 0.23 % do
  // not conform.
  static Production CapableOf(const ToleranceZone& zone);
};

// Probability that a part conforms, given a value measured with normally distributed error of
// standard uncertainty u > 0 (JCGM 106, 7 and 9.3.2). Without `production` the prior is flat, on
// values >= 0 for one-sided quantities. With p the result, 1 - p is the specific risk of wrong
// acceptance if the part is accepted, and p that of wrong rejection if it is
// rejected.
absl::StatusOr<double> ConformanceProbability(
    const ToleranceZone& zone, double measured_m, double uncertainty_m,
    const std::optional<Production>& production = std::nullopt);

// Probabilities for a part taken from production at random before it is measured (JCGM 106, 9.5).
struct GlobalProbabilities {
  double wrong_acceptance = 0;  // does not conform and is accepted ("consumer's risk")
  double wrong_rejection = 0;   // conforms and is not accepted ("producer's risk")
  double conforming = 0;        // share of production
  double accepted = 0;
};

// By quadrature over the true value v with density g_0, measured value N(v + bias, u^2), u >= 0:
//   R_C = int outside the tolerance P(accepted | v) g_0(v) dv,
//   R_P = int inside (1 - P(accepted | v)) g_0(v) dv          (JCGM 106 eq. 18, 19),
// accurate to 1e-9. InvalidArgument where a parameter is outside its range.
absl::StatusOr<GlobalProbabilities> DecisionProbabilities(const ToleranceZone& zone,
                                                          double uncertainty_m, double guard_factor,
                                                          const Production& production,
                                                          double bias_m = 0);

}  // namespace sightline
