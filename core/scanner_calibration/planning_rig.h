// SPDX-License-Identifier: Apache-2.0
// A calibrated scanner as planning describes one: camera and laser look at a common origin.
//
// The pupil and the laser plane stay where they are. The described camera's axis is the viewing ray
// of the image's centre, its rows are parallel to the laser plane: an image plane turned about the
// pupil sees the same rays. Its field of view is that of the real image up to keystone and
// distortion.
#pragma once

#include <Eigen/Core>

#include "absl/status/statusor.h"
#include "core/scanner_calibration/rig_adjustment.h"

namespace sightline {

struct PlanningRig {
  int columns_px = 0, rows_px = 0;  // columns along the laser line
  double focal_length_px = 0;
  double camera_distance_m = 0;        // pupil to laser plane along the axis
  double triangulation_angle_rad = 0;  // positive
  // Standard errors of distance and angle, to first order by the covariance of the adjusted rig.
  double camera_distance_error_m = 0, triangulation_angle_error_rad = 0;
  // Covariance of camera rotation, position, sheet tilts and offset, focal length and principal
  // point: the 12 x 12 of Calibration.covariance in proto/sightline/v1/uncertainty.proto. Points on
  // the laser plane have the covariance of the calibrated camera and plane, except for distortion,
  // which a pinhole lacks.
  Eigen::MatrixXd covariance;
  // Standard deviation of a point's displacement that the variables cannot describe, in parts of
  // that of its whole displacement (root mean square over the image).
  double covariance_misfit = 0;
};

// INVALID_ARGUMENT: the image's centre does not see the laser plane.
absl::StatusOr<PlanningRig> DescribeForPlanning(const AdjustedRig& rig, int columns_px,
                                                int rows_px);

}  // namespace sightline
