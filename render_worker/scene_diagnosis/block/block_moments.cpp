// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/block/block_moments.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

// Adds the speckle covariances of pixel (i, j) with itself and with the pixels of its block behind
// it to `sum`, in the order of the image; the latter twice, since each pair is met once.
double AddSpeckleOfPixel(const ExpectedPixels& pixels, const Image<double>& covariance,
                         int max_lag_px, const PixelBlock& block, int i, int j, double sum) {
  constexpr int kMiddle = kLargestLag_px;
  const double own = pixels.laser.At(i, j), own_diffracted = pixels.diffracted.At(i, j);
  const auto product = [&](int m, int n) {
    return own * pixels.laser.At(m, n) - own_diffracted * pixels.diffracted.At(m, n);
  };
  const int last_i = std::min(i + max_lag_px, block.top_px + block.size_px - 1);
  const int first_j = std::max(j - max_lag_px, block.left_px);
  const int last_j = std::min(j + max_lag_px, block.left_px + block.size_px - 1);
  sum += product(i, j) * covariance.At(kMiddle, kMiddle);
  for (int n = j + 1; n <= last_j; ++n) {
    sum += 2 * product(i, n) * covariance.At(kMiddle, kMiddle + n - j);
  }
  for (int m = i + 1; m <= last_i; ++m) {
    for (int n = first_j; n <= last_j; ++n) {
      sum += 2 * product(m, n) * covariance.At(kMiddle + m - i, kMiddle + n - j);
    }
  }
  return sum;
}

}  // namespace

BlockSums SumOverBlock(const ExpectedPixels& pixels, const Image<double>& speckle_covariance,
                       int max_lag_px, const PixelBlock& block) {
  BlockSums sums;
  for (int i = block.top_px; i < block.top_px + block.size_px; ++i) {
    for (int j = block.left_px; j < block.left_px + block.size_px; ++j) {
      sums.light += pixels.all.At(i, j);
      sums.photon_variance += std::max(0.0, pixels.all.At(i, j)) * pixels.other_slope.At(i, j);
      sums.diffracted += pixels.diffracted.At(i, j);
      if (pixels.laser.At(i, j) == 0) continue;
      sums.speckle_variance = AddSpeckleOfPixel(pixels, speckle_covariance, max_lag_px, block, i, j,
                                                sums.speckle_variance);
    }
  }
  return sums;
}

double StreakContrastSquared(const Image<double>& speckle_covariance, int block_px) {
  double contrast_squared = 0;
  for (int n = 0; n < block_px; ++n) {
    for (int m = 0; m < block_px; ++m) {
      if (std::abs(n - m) > kLargestLag_px) continue;
      contrast_squared +=
          speckle_covariance.At(kLargestLag_px, kLargestLag_px + n - m) / (block_px * block_px);
    }
  }
  return contrast_squared;
}

double ChangeWithMovement(const Image<double>& electrons, const PixelBlock& block) {
  const int top = block.top_px, left = block.left_px;
  const int below = std::min(top + block.size_px, electrons.rows_px - 1);
  const int beside = std::min(left + block.size_px, electrons.columns_px - 1);
  double down = 0, right = 0;
  for (int n = 0; n < block.size_px; ++n) {
    down += electrons.At(below, left + n) - electrons.At(top, left + n);
    right += electrons.At(top + n, beside) - electrons.At(top + n, left);
  }
  return std::hypot(down, right);
}

}  // namespace sightline
