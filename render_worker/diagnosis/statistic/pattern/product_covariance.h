// SPDX-License-Identifier: Apache-2.0
// Covariance of the mean products of pair_products.h.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/statistic/pattern/pair_products.h"
#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// Correlation of the residuals of one recording: the fraction of its variance that is speckle,
// times the correlation of speckle. Noise is uncorrelated.
struct ResidualCorrelation {
  double share = 0;
  const SpecklePixelCovariance* speckle = nullptr;  // of the ExpectedSet, which must outlive this

  double At(int rows, int columns) const {
    if (rows == 0 && columns == 0) return 1;
    return share * speckle->At(rows, columns) / speckle->At(0, 0);
  }
};

// Correlation of the residuals of every recording, on its row of largest weight.
std::vector<ResidualCorrelation> CorrelationsOfResiduals(const ExpectedSet& expected,
                                                         const std::vector<int>& frames,
                                                         const std::vector<RowWeights>& weights);

// Covariance by speckle and noise: with the correlations R_a, R_b of two recordings, lags l and m
// covary by the sum over k of R_a(k) R_b(k + d), for d = m - l and d = m + l, summed over all
// pairs. 0 for lags without weight. `total`: TotalWeights.
Eigen::MatrixXd CovarianceOfProducts(const std::vector<ResidualCorrelation>& correlations,
                                     const std::vector<RowWeights>& weights, const LagValues& total,
                                     int columns_px);

// Variance of the products at lag `l` by a random pattern of sensitivity of relative variance
// `prnu_squared`: multiplied with speckle and noise, and by its own finite sample. Per column, and
// not yet divided by the squared weights.
double VarianceBySensitivity(double prnu_squared, int l, const RowWeights& sum,
                             const std::vector<RowWeights>& weights);

}  // namespace sightline
