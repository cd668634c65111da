// SPDX-License-Identifier: Apache-2.0
// Factors between degrees and radians: 30 * kRadPerDeg is 30 degrees in radians.
#pragma once

#include <numbers>

namespace sightline {

inline constexpr double kRadPerDeg = std::numbers::pi / 180;
inline constexpr double kDegPerRad = 180 / std::numbers::pi;

}  // namespace sightline
