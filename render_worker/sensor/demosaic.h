// SPDX-License-Identifier: Apache-2.0
// Colour images from raw Bayer images.
#pragma once

#include <array>
#include <cstdint>

#include "absl/status/statusor.h"
#include "core/image/image.h"

namespace sightline {

enum class DemosaicMethod {
  kBilinear,
  // Gradient-corrected linear interpolation (Malvar, He, Cutler, ICASSP 2004).
  kMalvarHeCutler,
};

// Red, green, blue, the same size each.
using RgbImage = std::array<Image<float>, 3>;

// Interpolates the two missing colours of every pixel of an RGGB image. `row_px`, `column_px`:
// position of the first pixel on the sensor, both even for red (may be negative). The image is
// mirrored at its edges, which keeps the colours of the pattern. Malvar's values may lie outside
// [0, largest DN]: clamp for display. INVALID_ARGUMENT: less than 3 rows or columns.
absl::StatusOr<RgbImage> Demosaic(const Image<uint16_t>& raw_dn, int row_px, int column_px,
                                  DemosaicMethod method);

// Factors of red, green and blue that make the image's mean grey, with 1 for green (grey world,
// Buchsbaum 1980), after black_level_dn is subtracted. Pixels with a colour of at least
// `saturation_dn` are left out; <= 0: none are. All factors are 1 if a colour has no light.
std::array<double, 3> GreyWorldFactors(const RgbImage& image_dn, double black_level_dn,
                                       double saturation_dn);

// factor (value - black level) + black level.
void WhiteBalance(const std::array<double, 3>& factors, double black_level_dn, RgbImage* image_dn);

}  // namespace sightline
