// SPDX-License-Identifier: Apache-2.0
// The smooth course of light or dark current over the sensor: a polynomial of fourth degree in row
// and column.
#pragma once

#include "core/image/image.h"

namespace sightline {

// The polynomial is fitted to the interquartile means of at most kCellsPerSide x kCellsPerSide
// cells of the image, so that single outlying pixels have no influence.
inline constexpr int kCellsPerSide = 32;

// An image of the size of `image`, which has at least 8 x 8 pixels.
Image<double> SmoothCourse(const Image<double>& image);

}  // namespace sightline
