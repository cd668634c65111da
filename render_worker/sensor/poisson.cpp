// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/poisson.h"

#include <array>
#include <cassert>
#include <cmath>

namespace sightline {
namespace {

double Inversion(double mean, CounterRandom& random) {
  // Beyond mean + 40 standard deviations the rest is below the resolution of the uniform number.
  const double last = mean + 40 * std::sqrt(mean) + 40;
  double uniform = random.Uniform();
  double probability = std::exp(-mean);
  double k = 0;
  while (uniform >= probability && k < last) {
    uniform -= probability;
    ++k;
    probability *= mean / k;
  }
  return k;
}

double TransformedRejection(double mean, CounterRandom& random) {
  const double b = 0.931 + 2.53 * std::sqrt(mean);
  const double a = -0.059 + 0.02483 * b;
  const double v_r = 0.9277 - 3.6224 / (b - 2);
  for (;;) {
    const double u = random.Uniform() - 0.5;
    const double v = random.Uniform();
    const double us = 0.5 - std::abs(u);
    const double k = std::floor((2 * a / us + b) * u + mean + 0.43);
    if (us >= 0.07 && v <= v_r) return k;
    // Also refuses us = 0, where k is not finite.
    if (!(k >= 0) || (us < 0.013 && v > us)) continue;
    const double inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
    if (std::log(v * inverse_alpha / (a / (us * us) + b)) <=
        k * std::log(mean) - mean - LogFactorial(k)) {
      return k;
    }
  }
}

}  // namespace

double LogFactorial(double k) {
  assert(k >= 0);
  static const std::array<double, 16> small = [] {
    std::array<double, 16> table{};
    double factorial = 1;
    for (size_t i = 1; i < table.size(); ++i) table[i] = std::log(factorial *= i);
    return table;
  }();
  if (k < small.size()) return small[static_cast<size_t>(k)];
  // Stirling's series of ln Gamma(x), x = k + 1 >= 17; the next term is below 1e-14.
  const double x = k + 1, r = 1 / (x * x);
  return (x - 0.5) * std::log(x) - x + 0.91893853320467274 +
         (1.0 / 12 - r * (1.0 / 360 - r * (1.0 / 1260 - r * (1.0 / 1680)))) / x;
}

double PoissonNumber(double mean, CounterRandom& random) {
  assert(mean >= 0 && mean <= 1e9);
  return mean < 10 ? Inversion(mean, random) : TransformedRejection(mean, random);
}

}  // namespace sightline
