// SPDX-License-Identifier: Apache-2.0
// Speckle that is the sum of independent patterns.
#pragma once

#include <vector>

namespace sightline {

// Weights after each pattern is split by the same shares; shares {1} change nothing.
std::vector<double> SplitPatterns(const std::vector<double>& weights,
                                  const std::vector<double>& shares);

// Shares of `modes` equally strong patterns. Their squares sum to 1/modes, so speckle contrast is
// 1/sqrt(modes) also for fractional `modes` (then the last share is smaller).
std::vector<double> EqualModes(double modes);

}  // namespace sightline
