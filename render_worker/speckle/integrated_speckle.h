// SPDX-License-Identifier: Apache-2.0
// Distribution of speckle that is integrated over a pixel.
#pragma once

#include <vector>

namespace sightline {

// A pixel's irradiance is a sum of independent exponential variables, weighted with the eigenvalues
// of the field's coherence over the pixel (Goodman, Speckle Phenomena in Optics, on the exact
// distribution of integrated speckle). For Gaussian coherence and pixel the eigenvalues fall
// geometrically; one parameter remains, the squared contrast, in (0, 1]. For a circular pupil and a
// square pixel, the mean of the irradiance clipped at saturation agrees to 0.5 % (that of the Gamma
// distribution of the same contrast to 3 %). Towards a squared contrast of 0.05 it becomes the
// Gamma distribution.
//
// Returns levels as factors of the mean, `count` of equal weight: means of equally likely
// intervals; the last two are the mean of both intervals plus and minus their standard deviation.
// The levels have mean 1 and the distribution's variance. Clipping at any level keeps their mean to
// 3 %, above the mean to 0.5 %. Contrast 0: all levels are 1.
std::vector<double> SpeckleLevels(double contrast_squared, int count);

}  // namespace sightline
