// SPDX-License-Identifier: Apache-2.0
// Distribution function and density of the standard normal distribution.
#pragma once

#include <cmath>
#include <numbers>

namespace sightline {

inline double NormalDistribution(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }
inline double NormalDensity(double x) {
  return std::exp(-0.5 * x * x) / std::sqrt(2 * std::numbers::pi);
}

}  // namespace sightline
