// SPDX-License-Identifier: Apache-2.0
// Saliency of bright ridges by Gaussian derivatives (Steger, IEEE PAMI 20(2), 1998; thesis A.1).
#pragma once

#include <vector>

#include "core/image/image.h"

namespace sightline {

// Gaussian of standard deviation sigma_px and its first two derivatives, integrated over the pixels
// (Steger 1998, section 2.2) from -radius to radius; sums are 1, 0, 0.
struct GaussianDerivatives {
  int radius_px = 0;
  std::vector<float> smooth, first, second;
};
GaussianDerivatives MakeGaussianDerivatives(double sigma_px);

// Minus the Hessian's eigenvalue of largest magnitude [DN/px^2] where that is negative (bright
// ridge), else 0. Values beyond the image are mirrored at its edge; all values must be finite.
Image<float> RidgeScore(const Image<float>& image_dn, double sigma_px);

// Response to white noise of standard deviation 1 DN: the standard deviation of the second
// derivative along a column [DN/px^2].
double RidgeNoise(double sigma_px);

}  // namespace sightline
