// SPDX-License-Identifier: Apache-2.0
// Covariance that speckle, noise and the model's errors give a segment's mean profiles.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/statistic/profile_statistic.h"

namespace sightline {

// `samples`: expected frames of the segment; `columns_px`: its columns; `segments`: along the line;
// `means`: expected components.
Eigen::MatrixXd ProfileCovariance(const ProfileGroup& group, const std::vector<PixelPlane>& planes,
                                  const std::vector<ExpectedFrame>& samples, int columns_px,
                                  int segments, const Eigen::VectorXd& means);

}  // namespace sightline
