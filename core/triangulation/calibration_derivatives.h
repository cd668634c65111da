// SPDX-License-Identifier: Apache-2.0
// Effect of errors of the calibration on a measured point along its surface's normal.
#pragma once

#include <Eigen/Core>

#include "core/triangulation/triangulation.h"

namespace sightline {

// Variables 2 to 13 of TriangulationVariable: all but those of detection.
inline constexpr int kCalibrationVariables = kTriangulationVariables - 2;
// The variables of camera and laser come first; the rest are of the lens.
inline constexpr int kPlaceVariables = kFocalLengthError - kCameraAlpha;
using CalibrationRow = Eigen::Matrix<double, 1, kCalibrationVariables>;
using CalibrationCovariance = Eigen::Matrix<double, kCalibrationVariables, kCalibrationVariables>;

// Derivatives [m per unit] of the deviation along `normal` (unit) measured at `position_m` with
// respect to the calibration variables; not finite where the scan cannot measure the point.
CalibrationRow CalibrationDerivatives(const TriangulationSetup& setup,
                                      const Eigen::Vector3d& position_m,
                                      const Eigen::Vector3d& normal);

}  // namespace sightline
