// SPDX-License-Identifier: Apache-2.0
// Section `rig.robot` of an inspection, an arm or a table: its base and its load.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

struct MeasurementDomain;

struct RobotMount {
  enum class Load { kSensorHead, kPart };

  std::string urdf_file;  // absolute, or relative to the working directory
  std::string base_link;  // empty: the root of the URDF
  std::string tip_link;
  Load load = Load::kSensorHead;
  // x = base * x_base. Sensor heads: x in the cell, whose origin is below the centre of the part's
  // bounding box at the height of the part's lowest point, with the axes of the world and the stage
  // at 0. Parts: x in the world.
  Eigen::Isometry3d base = Eigen::Isometry3d::Identity();
  // x_tip = load_on_tip * x, x in the frame of the camera, or in part coordinates.
  Eigen::Isometry3d load_on_tip = Eigen::Isometry3d::Identity();
  std::vector<double> home;  // rad or m; empty: the middle of each joint's range
  double speed_fraction = 0.5;
  double acceleration_time_s = 0;  // from rest to that speed
};

// `message` has a rig.robot whose file name is resolved. INVALID_ARGUMENT names field and reason,
// also if the rest of the inspection contradicts a robot: a head is rigid, so camera distance and
// triangulation angle must be one value each, and obstacles must be in a frame that is at rest
// relative to the robot.
absl::StatusOr<RobotMount> ParseRobotMount(const v1::Inspection& message,
                                           const MeasurementDomain& domain,
                                           const std::string& context);

}  // namespace sightline
