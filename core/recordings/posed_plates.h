// SPDX-License-Identifier: Apache-2.0
// Fields of recordings.json that only format version 3 has: camera, laser plane, poses of the
// plate.
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/field_limits/field_checks.h"
#include "core/recordings/recordings.h"
#include "sightline/v1/recording.pb.h"

namespace sightline {

// Camera and laser plane. INVALID_ARGUMENT names the field: missing, focal length <= 0, principal
// point farther from the middle of the sensor than its size, a normal of length 0, an origin off
// the plane by more than 1 mm.
absl::StatusOr<PosedPlates> ParsePosedPlates(const v1::Recordings& message, const Sensor& sensor,
                                             const Checker& check);

// Takes points of the plate to camera coordinates. `path`: of the pose. INVALID_ARGUMENT: not nine
// numbers, not a rotation (within 1e-5 of an orthogonal matrix, determinant 1), or the plate's
// origin is not in front of the camera.
absl::StatusOr<Eigen::Isometry3d> ParsePlatePose(const v1::Recording::PlatePose& message,
                                                 const std::string& path, const Checker& check);

// INVALID_ARGUMENT: the laser plane is parallel to the plate or lights it from behind, or its line
// is nowhere in the region of interest. `path`: of the recording.
absl::Status CheckLineInRegion(const PosedPlates& posed, const Sensor& sensor,
                               const RecordedImage& image, const std::string& path,
                               const Checker& check);

// Part of a line of an image that lies in its region of interest, whole rows or columns of the
// sensor (`along_columns`).
struct LineInRegion {
  PlateLine line;
  bool along_columns = false;
  int first_px = 0, last_px = 0;  // one past the last
  Eigen::Vector3d start_m;        // a point of the line near the middle of the region
};
// Errors as CheckLineInRegion, without path.
absl::StatusOr<LineInRegion> FindLineInRegion(const PosedPlates& posed, const Sensor& sensor,
                                              const RecordedImage& image);

}  // namespace sightline
