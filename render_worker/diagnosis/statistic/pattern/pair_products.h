// SPDX-License-Identifier: Apache-2.0
// Mean products of the residuals of pairs of recordings, at several lags on the sensor. Speckle and
// noise are independent in different recordings, so the mean products estimate the autocovariance
// of the pattern that stays on the sensor.
#pragma once

#include <array>
#include <iterator>
#include <vector>

#include "core/image/image.h"
#include "render_worker/diagnosis/statistic/pattern/relative_residuals.h"
#include "render_worker/frame/frame_setup.h"

namespace sightline {

struct Lag {
  int rows, columns;
};
// Chosen: the pixel itself, three pixels away in both directions (beyond the correlation of speckle
// and the cell of a colour filter), and doubling distances along the line for dust and fringes.
inline constexpr Lag kLags[] = {{0, 0}, {0, 3}, {3, 0}, {0, 8}, {0, 16}, {0, 32}};
inline constexpr int kLagCount = static_cast<int>(std::size(kLags));
using LagValues = std::array<double, kLagCount>;

// Sum of the weights of all recordings.
RowWeights SumOfWeights(const std::vector<RowWeights>& each);

// Product of the weight of a pixel and of the pixel a lag away, summed over pairs of different
// recordings. `sum`: SumOfWeights(each); `parity`: of the pixel's column.
double PairWeight(const RowWeights& sum, const std::vector<RowWeights>& each, int row, int parity,
                  const Lag& lag);

// Sum of PairWeight over all pixels of a region, at every lag.
LagValues TotalWeights(const RowWeights& sum, const std::vector<RowWeights>& each,
                       const RegionOfInterest& roi);

// Mean product of a pattern with itself at every lag, weighted like the pairs of recordings.
// `first_row`: row of the region that row 0 of the pattern is.
LagValues Autocovariance(const Image<double>& pattern, int first_row, const RowWeights& sum,
                         const std::vector<RowWeights>& each);

}  // namespace sightline
