// SPDX-License-Identifier: Apache-2.0
// Curvature of surfaces that features of drawings consist of.
#pragma once

#include <Eigen/Core>

#include "core/association/nominal_surface.h"

namespace sightline {

// Second derivatives of SignedDistance at a point of the surface [1/m]: H = k_1 t_1 t_1' +
// k_2 t_2 t_2' with principal curvatures k and principal directions t. Positive curvatures bend
// away from DistanceGradient: a sphere of radius R has 1/R twice. Zero for planes, for free-form
// surfaces and on an axis.
Eigen::Matrix3d DistanceHessian(const NominalSurface& surface, const Eigen::Vector3d& point_m);

}  // namespace sightline
