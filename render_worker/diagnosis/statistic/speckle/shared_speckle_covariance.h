// SPDX-License-Identifier: Apache-2.0
// Covariance of the components of SharedSpeckleStatistic.
#pragma once

#include <Eigen/Core>

#include "render_worker/diagnosis/statistic/speckle/exposure_pair.h"
#include "render_worker/diagnosis/statistic/speckle/shared_speckle_moments.h"

namespace sightline {

// A component with fewer pixels is made uninformative. Chosen: the mean of as many pixels is close
// to normally distributed.
inline constexpr double kFewPixelsOfBin = 50;

// `moments`: from ExpectSharedSpeckle, with `common`.
Eigen::MatrixXd SharedSpeckleCovariance(const ExpectedSet& expected,
                                        const SharedSpeckleBlock& block,
                                        const SharedSpeckleMoments& moments);

}  // namespace sightline
