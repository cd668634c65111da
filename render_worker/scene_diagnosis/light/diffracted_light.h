// SPDX-License-Identifier: Apache-2.0
// Separates light that diffraction and blur spread far from its geometric image from light near
// that image. Its speckle is elongated towards its source, so a block of pixels contains fewer
// independent grains of it (block/block_moments.h).
#pragma once

#include "core/image/image.h"

namespace sightline {

// The part of `electrons` beyond the geometric image within two pixels:
//   d_ij = max(0, y_ij - c max of L over |di|, |dj| <= 2),  c = sum y / sum L,
// with y the mean photo-electrons and L the radiance of the geometric image of the same light. Both
// images have the same size. Without any radiance all of `electrons` is returned.
Image<double> DiffractedElectrons(const Image<double>& electrons, const Image<float>& radiance);

}  // namespace sightline
