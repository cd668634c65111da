// SPDX-License-Identifier: Apache-2.0
// Pixels of dark frames that stand out, and the variance of a random dark pattern.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/image/image.h"

namespace sightline {

// A pixel above this many standard deviations of the nominal noise is an outlier. Chosen: normal
// noise has one in three million pixels.
inline constexpr double kDarkOutlier = 5;
// Residuals are clipped to this many standard deviations, so that a few hot pixels do not dominate
// mean products. Chosen: noise hardly reaches it.
inline constexpr double kDarkLimit = 4;
double ClippedResidual(double residual);

// The Anscombe transform 2 sqrt(n + 3/8) of a Poisson count n has a variance of 1 (Anscombe,
// Biometrika 35 (1948) 246).
inline constexpr double kAnscombe = 0.375;

// Expected pixels that are outliers both in a frame and in the longest exposure, for every frame; 0
// for the longest exposure. `frames`: noise-free residuals in units of the nominal noise.
Eigen::VectorXd OutlierCounts(const std::vector<Image<double>>& frames, size_t longest);

// Covariance, between realisations of a pattern of independent pixels, of the mean product of its
// pixels (component 0) and of every frame's Anscombe-transformed outlier count (components 1 and
// following). Counts covary because the same pixels are outliers in all frames.
Eigen::MatrixXd CovarianceOfRealisations(const std::vector<Image<double>>& frames, size_t longest);

}  // namespace sightline
