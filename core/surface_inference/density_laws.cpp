// SPDX-License-Identifier: Apache-2.0
// Closed forms for surfaces on which the points lie densely.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "core/statistics/square.h"
#include "core/surface_inference/surface_inference.h"

namespace sightline {
namespace {

// Value of the spectrum S at frequency 0 [m^4].
double SpectrumAtZero(const SurfacePrior& prior) {
  return Square(prior.standard_deviation_m) * 2 * std::numbers::pi * Square(prior.length_scale_m);
}

// ln(ln(1 + a) / a) for a = exp(ln_a); 0 as a -> 0.
double LogVarianceRatio(double ln_a) {
  if (ln_a < -30) return 0;  // -a/2, below the rounding of a ratio near 1
  // Beyond exp(40), ln(1 + a) = ln a to rounding; also keeps exp from overflowing.
  if (ln_a > 40) return std::log(ln_a) - ln_a;
  const double a = std::exp(ln_a);
  return std::log(std::log1p(a) / a);
}

}  // namespace

double UncertaintyAtDensity(const SurfacePrior& prior, double information_density_per_m4) {
  assert(information_density_per_m4 >= 0);
  const double a = information_density_per_m4 * SpectrumAtZero(prior);
  if (!(a > 0)) return prior.standard_deviation_m;
  return prior.standard_deviation_m * std::exp(0.5 * LogVarianceRatio(std::log(a)));
}

double DensityForUncertainty(const SurfacePrior& prior, double uncertainty_m) {
  assert(uncertainty_m > 0 && uncertainty_m < prior.standard_deviation_m);
  // ln(ln(1 + a) / a) falls with ln a, from 0 towards -ln a: bisect between bounds of it. As
  // ln(1 + a) / a <= 1 / sqrt(1 + a) the upper bound holds for every u; the lower is a < 2e-13.
  const double wanted = 2 * std::log(uncertainty_m / prior.standard_deviation_m);
  double low = -30, high = std::max(1.0, -2 * wanted + 1);
  while (high - low > 1e-14 * std::max(1.0, std::abs(high))) {
    const double middle = 0.5 * (low + high);
    if (middle == low || middle == high) break;
    (LogVarianceRatio(middle) > wanted ? low : high) = middle;
  }
  return std::exp(0.5 * (low + high)) / SpectrumAtZero(prior);
}

double SamplingVariance(const SurfacePrior& prior, double spacing_m) {
  assert(spacing_m > 0);
  const double variance_m2 = Square(prior.standard_deviation_m);
  const double beyond =
      std::erfc(std::numbers::pi * prior.length_scale_m / (std::numbers::sqrt2 * spacing_m));
  return variance_m2 * std::min(1.0, 2 * beyond);
}

double BorderUncertainty(const SurfacePrior& prior, double information_density_per_m4,
                         double border_distance_m) {
  const double u = UncertaintyAtDensity(prior, information_density_per_m4);
  const double full = std::log(prior.standard_deviation_m / u);
  if (!(full > 0)) return prior.standard_deviation_m;
  const double a = information_density_per_m4 * SpectrumAtZero(prior);
  // The constants are fitted for 300 <= a <= 1e9.
  const double log_a = std::log1p(std::clamp(a, 300.0, 1e9));
  const double rise = std::clamp(0.336 * std::sqrt(std::log1p(a)) - 0.195, 0.0, full);
  const double x = border_distance_m / prior.length_scale_m;
  if (x >= 0) return u * std::exp(rise / (1 + rise * x / 0.0865));
  const double decay = (1.475 - 1.105 / log_a) * -x + (3.44 / log_a - 0.116) * -x * x * x;
  return prior.standard_deviation_m * std::exp(-(full - rise) * std::exp(-decay));
}

}  // namespace sightline
