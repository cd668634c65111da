// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/significance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/evidence/model_prior.h"

namespace sightline {

double BayesFactorBound(double p_value) {
  if (p_value >= 1 / std::numbers::e) return 1;
  constexpr double kLeast = 1e-300;
  const double p = std::max(p_value, kLeast);
  return -1 / (std::numbers::e * p * std::log(p));
}

double ProbabilityOfUnknown(double p_value) {
  const double odds = kPriorOfUnknown / (1 - kPriorOfUnknown) * BayesFactorBound(p_value);
  return odds / (1 + odds);
}

}  // namespace sightline
