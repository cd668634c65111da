// SPDX-License-Identifier: Apache-2.0
// Range of the laser line in a profile.
#pragma once

#include <utility>
#include <vector>

namespace sightline {

// Rows to show of profiles across the line: those where `signal` stands out by more than 5 % of its
// height above its least value, and as much again on both sides; at least 24 rows, within the rows
// given. All rows if there is no line. `rows` ascending, not empty; `signal` of the same size.
std::pair<double, double> LineRange(const std::vector<double>& rows,
                                    const std::vector<double>& signal);

}  // namespace sightline
