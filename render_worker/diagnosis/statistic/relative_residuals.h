// SPDX-License-Identifier: Apache-2.0
// How pixels differ from their neighbours on the line, relative to its light.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image/image.h"

namespace sightline {

// Least signal for a row to count, relative to the largest number.
inline constexpr double kLeastSignal_relative = 0.02;

// Residuals of a recording's rows about their blocks' means, even and odd columns apart; 0 where
// there is hardly light.
struct RelativeResiduals {
  // Relative residuals times the row's information on a pixel's relative sensitivity.
  Image<double> value;
  // That information, squared signal over variance, of every row's even and odd columns.
  std::vector<double> weights;
};

// `offset_dn`: mean in the dark; `top_dn`: largest number.
RelativeResiduals MakeRelativeResiduals(const Image<uint16_t>& raw, double offset_dn, double top_dn,
                                        int blocks);

}  // namespace sightline
