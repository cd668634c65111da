// SPDX-License-Identifier: Apache-2.0
// Smooth trend of light or dark current over the sensor: a polynomial of fourth degree in row and
// column.
#pragma once

#include "core/image/image.h"

namespace sightline {

// Number of cells per side at most. The polynomial is fitted to the interquartile means of the
// cells of the image, so that single outlying pixels have no influence.
inline constexpr int kCellsPerSide = 32;

// Returns an image of the size of `image`, which must have at least 8 x 8 pixels.
Image<double> SmoothCourse(const Image<double>& image);

}  // namespace sightline
