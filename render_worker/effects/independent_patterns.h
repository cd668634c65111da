// SPDX-License-Identifier: Apache-2.0
// Speckle that is the sum of independent patterns.
#pragma once

#include <vector>

namespace sightline {

// Weights of patterns of which each is split by the same shares; shares {1} change nothing.
std::vector<double> SplitPatterns(const std::vector<double>& weights,
                                  const std::vector<double>& shares);

// Shares of `modes` equally strong patterns: squares sum to 1/modes, so speckle contrast is
// 1/sqrt(modes) also between whole numbers (there the last share is the smaller one).
std::vector<double> EqualModes(double modes);

}  // namespace sightline
