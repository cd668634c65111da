// SPDX-License-Identifier: Apache-2.0
// Uncertainty of line detection as a function of distance and angle of incidence, learned from
// rendered images of one setting. Planning of the geometry uses it.
//
// Blocks of image columns b, with c_b crossings of the true line seen from the distance d_b at the
// angle of incidence t_b, of which f_b are found, with deviations e of the detected from the true
// row about their mean over all blocks. With x and y the distance and angle less their means, over
// their standard deviations, and phi = (1, x, x^2, y, y^2, x y),
//   ln sigma^2 = beta . phi,   sum of e^2 in b ~ sigma^2 times chi-squared with f_b degrees,
//   logit a    = alpha . phi,  f_b ~ binomial of c_b with probability a,
// both by quasi-likelihood (Wedderburn 1974; McCullagh and Nelder, Generalized Linear Models,
// 1989, chapters 8, 9): neighbouring columns share speckle, so the variances are multiplied by a
// dispersion, the mean of the squared Pearson residuals, at least 1.
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

// Over a grid of distances and angles, [distance][angle].
struct DetectionNoise {
  std::vector<double> distances_m, incidence_angles_rad;  // ascending
  std::vector<double> u_px;
  std::vector<double> relative_standard_error;  // of u_px
  double bias_px = 0;                           // mean deviation, which u_px leaves out
  double deviation_dispersion = 1, found_dispersion = 1;
};

// Unset: fewer than 100 points were found, which are too few. Coefficients other than the first
// have normal priors of standard deviation 1, so that a direction that the blocks do not vary in
// stays flat. The grid has up to six steps each way, between the 1st and the 99th percentile of the
// crossings; one where they are all alike. u_px is at most 100, which stands for no information.
std::optional<DetectionNoise> LearnDetectionNoise(std::span<const DetectedBlock> blocks);

}  // namespace sightline
