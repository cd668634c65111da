// SPDX-License-Identifier: Apache-2.0
// Expected moments of the pixels of SharedSpeckleStatistic: sums over equally likely levels of
// speckle, each blurred by noise over the bins.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/diagnosis/statistic/speckle/exposure_pair.h"

namespace sightline {

struct SharedSpeckleMoments {
  // For every component: pixels, sum of the compared value over them, sum of its noise variance.
  Eigen::VectorXd count, sum, noise;
  // For every bin: sum of squared differences over their nominal variance, and sum of one over the
  // nominal variance.
  Eigen::VectorXd square, weight;
  // For every pair but the last: covariance sums of its bins with those of the next pair, by the
  // noise of the recording that both contain.
  std::vector<Eigen::MatrixXd> common;
  std::vector<double> decorrelation;  // of the speckle of every pair
  // For every component, by row: pixels (for the variance ratio: relative variance) that share the
  // row's random offset; empty: rows have none.
  Eigen::MatrixXd of_rows;
};

// `with_common`: also compute `common`, which only the covariance needs.
SharedSpeckleMoments ExpectSharedSpeckle(const ExpectedSet& expected,
                                         const SharedSpeckleBlock& block, bool with_common);

// Variance of y_b - r y_a by random row offsets [DN^2].
double RowOffsetVariance(const ExpectedFrame& a, const ExpectedFrame& b, double ratio);

}  // namespace sightline
