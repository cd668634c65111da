// SPDX-License-Identifier: Apache-2.0
#include "render_worker/effects/independent_patterns.h"

#include <algorithm>
#include <cmath>

namespace sightline {

std::vector<double> SplitPatterns(const std::vector<double>& weights,
                                  const std::vector<double>& shares) {
  std::vector<double> split;
  for (const double share : shares) {
    if (share == 0) continue;
    for (const double weight : weights) split.push_back(weight * share);
  }
  return split;
}

std::vector<double> EqualModes(double modes) {
  const double whole = std::floor(modes);
  const auto count = static_cast<size_t>(whole);
  if (modes == whole) return std::vector<double>(count, 1 / whole);
  // n a + b = 1 and n a^2 + b^2 = 1/M.
  const double root = 1 - (whole + 1) * (1 - 1 / modes) / whole;
  const double share = (1 + std::sqrt(std::max(0.0, root))) / (whole + 1);
  std::vector<double> shares(count, share);
  shares.push_back(std::max(0.0, 1 - whole * share));
  return shares;
}

}  // namespace sightline
