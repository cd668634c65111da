// SPDX-License-Identifier: Apache-2.0
// Poses of camera, laser and part of a planned scan in the machine.
#pragma once

#include <Eigen/Geometry>

#include "absl/status/statusor.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// World: origin where the camera's optical axis meets the laser plane, x the stage's direction of
// travel, z up. Camera and laser stand still during a scan, the part moves along +x with the stage.
// Sensor frames: z the viewing direction, x along the image rows and the laser line, y down in the
// image (the optical frame of ROS REP 103).
struct ScanFrames {
  Eigen::Isometry3d camera = Eigen::Isometry3d::Identity();  // x_world = M x_sensor
  Eigen::Isometry3d laser = Eigen::Isometry3d::Identity();
  // x_world = M x_cad with the stage at 0.
  Eigen::Isometry3d part = Eigen::Isometry3d::Identity();

  // x_world = M x_cad with the stage at `stage_m`.
  Eigen::Isometry3d PartAt(double stage_m) const;
};

// Frames from the poses in plan.json. INVALID_ARGUMENT names the scan and the pose that does not
// have 16 finite numbers, or is not a rigid transformation (to 1e-6).
absl::StatusOr<ScanFrames> FramesOfScan(const v1::PlannedScan& scan);

// Quaternion of a rotation with w >= 0, so that each rotation has one text.
Eigen::Quaterniond QuaternionOf(const Eigen::Isometry3d& pose);

}  // namespace sightline
