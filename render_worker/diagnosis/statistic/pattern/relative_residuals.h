// SPDX-License-Identifier: Apache-2.0
// Relative deviation of pixels from their neighbours on the line.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image/image.h"

namespace sightline {

// Information on the relative sensitivity of a pixel: squared signal over variance, of the even and
// odd columns of every row (index 2 * row + column % 2); 0 where there is hardly any light.
using RowWeights = std::vector<double>;

// Least signal of a row that counts, relative to the largest raw value. Chosen: above dark noise.
inline constexpr double kLeastSignal_relative = 0.02;

// Residuals of a recording's rows about the means of their segments along the line, for even and
// odd columns separately because a colour sensor's differ.
struct RelativeResiduals {
  Image<double> value;  // relative residual times the row's weight
  RowWeights weights;
};

// `offset_dn`: mean in the dark; `top_dn`: largest raw value; `segments`: along the line.
RelativeResiduals MakeRelativeResiduals(const Image<uint16_t>& raw, double offset_dn, double top_dn,
                                        int segments);

}  // namespace sightline
