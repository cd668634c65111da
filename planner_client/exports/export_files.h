// SPDX-License-Identifier: Apache-2.0
// A plan as files for stage controllers, robots and spreadsheets. Numbers are the shortest decimals
// that read back as the same doubles; the same plan gives the same bytes.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

struct ExportFile {
  std::string name;  // "scans.csv"
  std::string contents;
};

// scans.csv            a row per scan: poses as position [mm] and quaternion, start, stop, triggers
// triggers.csv         a row per frame: stage position [mm]
// poses.json           4 x 4 matrices [m] of camera, laser and part, frames named
// camera_poses.yaml    ROS geometry_msgs/PoseArray of the cameras in the world
// transforms.yaml      ROS geometry_msgs/TransformStamped of every frame, with the same as a URDF
//                      origin (xyz, rpy)
// INVALID_ARGUMENT as FramesOfScan.
absl::StatusOr<std::vector<ExportFile>> ExportPlan(const v1::Plan& plan);

}  // namespace sightline
