// SPDX-License-Identifier: Apache-2.0
// Uncertainty of line detection as a function of distance and angle of incidence, learned from
// rendered images of one setting. Planning of the geometry uses it.
//
// Data: blocks of image columns b. Of c_b crossings of the true line, seen from the distance d_b at
// the angle of incidence t_b, f_b are found; e is the deviation of the detected from the true row,
// less the mean over all blocks. With standardised distance x and angle y (less their means, over
// their standard deviations), and phi = (1, x, x^2, y, y^2, x y),
//   ln sigma^2 = beta . phi,   sum of e^2 in b ~ sigma^2 times chi-squared with f_b degrees,
//   logit a    = alpha . phi,  f_b ~ binomial of c_b with probability a,
// both by quasi-likelihood (Wedderburn 1974; McCullagh and Nelder, Generalized Linear Models, 1989,
// chapters 8, 9). Neighbouring columns share speckle, so the variances are multiplied by a
// dispersion: the mean of the squared Pearson residuals, at least 1.
//
// A line that is found in a fraction a of the columns with the variance sigma^2 is as informative
// as one that is found in all of them with
//   u^2 = sigma^2 / a,
// since the information of points adds up. Planning reads u.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace sightline {

struct DetectedBlock {
  double distance_m = 0;     // mean over the block's crossings
  double incidence_rad = 0;  // likewise
  // Sums over crossings and realisations.
  double crossings = 0, found = 0;
  double deviation_px = 0, deviation2_px2 = 0;
};

// Values over a grid of distances and angles, [distance][angle].
struct DetectionNoise {
  std::vector<double> distances_m, incidence_angles_rad;  // ascending
  std::vector<double> u_px;
  std::vector<double> relative_standard_error;  // of u_px
  double bias_px = 0;                           // mean deviation, not contained in u_px
  double deviation_dispersion = 1, found_dispersion = 1;
};

// Nothing if fewer than 100 points were found. All coefficients except the first have normal priors
// of standard deviation 1, so that directions in which the blocks do not vary stay flat. The grid
// has up to six steps in each direction, between the 1st and the 99th percentile of the crossings,
// or one if they are all equal. u_px is limited to 100, which means no information.
std::optional<DetectionNoise> LearnDetectionNoise(std::span<const DetectedBlock> blocks);

}  // namespace sightline
