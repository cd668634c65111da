// SPDX-License-Identifier: Apache-2.0
// Errors of the modelled mean profiles: in the wings of the line's image and at the region's edge,
// where the model's approximations fail, and small relative errors everywhere.
#pragma once

#include <Eigen/Core>

#include "render_worker/diagnosis/statistic/profile_statistic.h"

namespace sightline {

// Signal that is left at the region's edge, for every component [DN]. It is estimated from the fall
// of the signal between two thirds of the way and the edge: the line spread function of a
// hard-edged pupil falls off with the square of the distance.
Eigen::VectorXd EdgeSignals(const Eigen::VectorXd& means, const ProfileGroup& group);

// Adds noise, saturation and the model's errors to a covariance by speckle. Errors of the wings and
// of the edge are common to all components of a block, and to all `segments` blocks along the line,
// which the fit treats as independent; so their variances are multiplied by that number.
void AddModelErrors(const Eigen::VectorXd& means, const ProfileGroup& group, int segments,
                    const Eigen::VectorXd& noise_variance,
                    const Eigen::VectorXd& saturation_variance, Eigen::MatrixXd& covariance);

}  // namespace sightline
