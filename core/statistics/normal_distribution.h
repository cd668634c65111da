// SPDX-License-Identifier: Apache-2.0
// The standard normal distribution N(0, 1).
#pragma once

#include <cmath>
#include <numbers>

namespace sightline {

// Density exp(-x^2 / 2) / sqrt(2 pi).
inline double NormalDensity(double x) {
  return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
}

// P(X <= x), precise in the lower tail.
inline double NormalDistribution(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

// P(X > x), precise in the upper tail.
inline double NormalUpperTail(double x) { return 0.5 * std::erfc(x / std::numbers::sqrt2); }

// P(|X| > |z|).
inline double NormalTwoSidedTail(double z) { return std::erfc(std::abs(z) / std::numbers::sqrt2); }

// The logarithm of P(X <= x), also where that is below the least double.
double LogOfNormalDistribution(double x);

// The x with P(X <= x) = p; p in (0, 1), clamped to [1e-12, 1 - 1e-12].
double NormalQuantile(double p);

// The z >= 0 with P(|X| > z) = p; p in (0, 1].
double NormalTwoSidedQuantile(double p);

}  // namespace sightline
