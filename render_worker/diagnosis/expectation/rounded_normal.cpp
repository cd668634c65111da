// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/rounded_normal.h"

#include <algorithm>
#include <cmath>

#include "core/statistics/normal_distribution.h"

namespace sightline {
namespace {

constexpr double kCoarse_dn = 0.7;
constexpr double kFarOut = 6;  // standard deviations beyond which nothing lies
// A mean that is never exactly so, and pixels that are never exactly alike: keeps the variance of
// numbers that are nearly always the same above zero.
constexpr double kLeastVariance_dn2 = 1e-4;

}  // namespace

bool IsCoarselyRounded(double standard_deviation_dn, int step_dn) {
  return standard_deviation_dn < kCoarse_dn * step_dn;
}

RoundedMoments MomentsAfterRounding(double mean_dn, double standard_deviation_dn, int step_dn) {
  if (step_dn > 1) {
    // round(x) cut to a multiple of s is s round((x - (s - 1)/2)/s).
    RoundedMoments moments = MomentsAfterRounding((mean_dn - 0.5 * (step_dn - 1)) / step_dn,
                                                  standard_deviation_dn / step_dn);
    moments.mean *= step_dn;
    moments.variance *= step_dn * step_dn;
    return moments;
  }
  const double reach = kFarOut * standard_deviation_dn;
  const double first = std::max(0.0, std::floor(mean_dn - reach + 0.5));
  const double last = std::max(first, std::floor(mean_dn + reach + 0.5));
  // About `first`, so that large means lose no digits.
  double sum = 0, moments[5] = {0, 0, 0, 0, 0};
  double below = 0;  // all that is smaller becomes the first number
  for (double n = first; n <= last; ++n) {
    const double up_to =
        n == last ? 1 : NormalDistribution((n + 0.5 - mean_dn) / standard_deviation_dn);
    const double probability = up_to - below;
    below = up_to;
    double power = probability;
    for (double& moment : moments) {
      moment += power;
      power *= n - first;
    }
    sum += probability;
  }
  const double m = moments[1] / sum;
  const double variance = std::max(moments[2] / sum - m * m, kLeastVariance_dn2);
  const double fourth = moments[4] / sum - 4 * m * moments[3] / sum + 6 * m * m * moments[2] / sum -
                        3 * m * m * m * m;
  return {first + m, variance, fourth / (variance * variance) - 3};
}

}  // namespace sightline
