// SPDX-License-Identifier: Apache-2.0
#include "planner_client/exports/scan_frames.h"

#include <cmath>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

absl::StatusOr<Eigen::Isometry3d> ReadPose(const v1::Pose& pose, int scan, const char* name) {
  const auto wrong = [&](const char* why) {
    return absl::InvalidArgumentError(absl::StrFormat("scan %d: %s.matrix %s", scan, name, why));
  };
  if (pose.matrix_size() != 16) return wrong("must have 16 numbers");
  Eigen::Matrix4d matrix;
  for (int i = 0; i < 16; ++i) matrix(i / 4, i % 4) = pose.matrix(i);
  if (!matrix.allFinite()) return wrong("has numbers that are not finite");
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const bool rigid = (rotation * rotation.transpose()).isIdentity(1e-6) &&
                     rotation.determinant() > 0 &&
                     matrix.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), 1e-6);
  if (!rigid) return wrong("is no rotation and translation");
  return Eigen::Isometry3d(matrix);
}

}  // namespace

Eigen::Isometry3d ScanFrames::PartAt(double stage_m) const {
  Eigen::Isometry3d moved = part;
  moved.translation().x() += stage_m;
  return moved;
}

absl::StatusOr<ScanFrames> FramesOfScan(const v1::PlannedScan& scan) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto part,
                             ReadPose(scan.part_pose(), scan.index(), "part_pose"));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto camera,
                             ReadPose(scan.camera_pose(), scan.index(), "camera_pose"));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto laser,
                             ReadPose(scan.laser_pose(), scan.index(), "laser_pose"));
  ScanFrames frames;
  frames.part = part;
  // The plan has them in the CAD frame with the stage at the scan's start.
  const Eigen::Isometry3d at_start = frames.PartAt(scan.stage_start_m());
  frames.camera = at_start * camera;
  frames.laser = at_start * laser;
  return frames;
}

Eigen::Quaterniond QuaternionOf(const Eigen::Isometry3d& pose) {
  Eigen::Quaterniond quaternion(pose.linear());
  quaternion.normalize();
  if (quaternion.w() < 0) quaternion.coeffs() *= -1;
  return quaternion;
}

}  // namespace sightline
