// SPDX-License-Identifier: Apache-2.0
// calibration_set.json and the files that it names, read and checked.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scanner_calibration/rig_adjustment.h"
#include "sightline/v1/calibration_set.pb.h"

namespace sightline {

struct CalibrationSetFrame {
  std::string name;   // of the image file
  std::string image;  // path
  std::optional<Eigen::Isometry3d> flange_in_base;
};

// n . x = d in camera coordinates, |n| = 1, d > 0.
struct PlaneInCamera {
  Eigen::Vector3d normal;
  double distance_m = 0;
};

struct CalibrationSet {
  std::string name, file;
  TargetBoard board;
  std::optional<CameraPrior> camera;
  std::vector<CalibrationSetFrame> frames;  // sorted by name
  std::optional<double> saturation_dn;
  std::optional<PlaneInCamera> reference_plane;
  v1::AssumedDevices assumed;
};

inline constexpr size_t kFewestCalibrationFrames = 4;

// Reads FOLDER/calibration_set.json. NOT_FOUND or INVALID_ARGUMENT names file, field and reason:
// unknown or missing fields, values outside their range, files that are missing or have other
// content, fewer than four images, an image without its pose, a quaternion not of unit length.
absl::StatusOr<CalibrationSet> ReadCalibrationSet(const std::string& folder);

}  // namespace sightline
