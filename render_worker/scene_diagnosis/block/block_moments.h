// SPDX-License-Identifier: Apache-2.0
// Sums over the pixels of one block that determine mean and variance of the block's mean.
#pragma once

#include "core/image/image.h"
#include "render_worker/scene_diagnosis/block/expected_pixels.h"

namespace sightline {

// Largest distance of two pixels for tabulated covariances of speckle [px]. It covers the Airy
// radius of apertures up to about f/45 on 5 um pixels; correlation beyond it is neglected.
inline constexpr int kLargestLag_px = 6;

// A block's first pixel and its side.
struct PixelBlock {
  int top_px = 0, left_px = 0, size_px = 1;
};

struct BlockSums {
  double light = 0;  // sum of means [electrons]
  // Variance of the sum by photon noise [electrons^2]: the part of light that is not clipped.
  double photon_variance = 0;
  // Variance of the sum by speckle of light that is not diffracted from afar [electrons^2].
  double speckle_variance = 0;
  double diffracted = 0;  // sum of light from afar [electrons]
};

// `speckle_covariance`: covariance of two pixels over the product of their means, with lag 0 in the
// middle of an image of 2 kLargestLag_px + 1 rows and columns. Lags above `max_lag_px` <=
// kLargestLag_px are left out. Fields of near and diffracted light add up, so that the speckle of
// their product remains correlated as usual.
BlockSums SumOverBlock(const ExpectedPixels& pixels, const Image<double>& speckle_covariance,
                       int max_lag_px, const PixelBlock& block);

// Squared contrast of the mean over a block of streaks along one of its sides, so that pixels
// differ only in the other direction.
double StreakContrastSquared(const Image<double>& speckle_covariance, int block_px);

// Change of the sum of a block when the image moves by one pixel down or right: light gained minus
// light lost at its edges; root of the sum of squares [electrons / px].
double ChangeWithMovement(const Image<double>& electrons, const PixelBlock& block);

}  // namespace sightline
