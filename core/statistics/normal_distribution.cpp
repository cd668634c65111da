// SPDX-License-Identifier: Apache-2.0
#include "core/statistics/normal_distribution.h"

#include <algorithm>
#include <boost/math/special_functions/erf.hpp>

namespace sightline {
namespace {

// In double precision throughout: Boost would go through long double, ten times slower.
using InDouble = boost::math::policies::policy<boost::math::policies::promote_double<false>>;

}  // namespace

double LogOfNormalDistribution(double x) {
  // Phi(x) = phi(x) / -x for x -> -infinity; at -30 the relative error is 1/900.
  if (x < -30) return -0.5 * x * x - std::log(-x) - 0.5 * std::log(2 * std::numbers::pi);
  return std::log(NormalDistribution(x));
}

double NormalQuantile(double p) {
  return -std::numbers::sqrt2 *
         boost::math::erfc_inv(2 * std::clamp(p, 1e-12, 1 - 1e-12), InDouble());
}

double NormalTwoSidedQuantile(double p) {
  return std::numbers::sqrt2 * boost::math::erfc_inv(p, InDouble());
}

}  // namespace sightline
