// SPDX-License-Identifier: Apache-2.0
// The law of speckle that is integrated over a pixel.
#pragma once

#include <vector>

namespace sightline {

// A pixel's irradiance is a sum of independent exponential ones, weighted with the eigenvalues of
// the field's coherence over the pixel (Goodman, Speckle Phenomena in Optics, on the exact law of
// integrated speckle). These fall off geometrically if coherence and pixel are Gaussian, which
// leaves one parameter, the squared contrast, in (0, 1]; a circular pupil and a square pixel agree
// with that to half a percent of a mean that saturation cuts off, the Gamma law of the same
// contrast to three. Towards 0.05 it becomes the Gamma law.
//
// Factors of the mean, `count` of equal weight: averages of equally likely intervals, but of the
// last two together their average plus and minus their standard deviation. Mean 1 and the law's
// variance; what is cut off at any level keeps its mean to 3 %, beyond the mean to half a percent.
// Contrast 0: all 1.
std::vector<double> SpeckleLevels(double contrast_squared, int count);

}  // namespace sightline
