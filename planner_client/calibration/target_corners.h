// SPDX-License-Identifier: Apache-2.0
// Runs the program that finds a checkerboard in images. It is separate to keep OpenCV out of here.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scanner_calibration/rig_adjustment.h"

namespace sightline {

inline constexpr char kTargetCornersProgram[] = "sightline_target_corners";

struct FoundTargets {
  int columns_px = 0, rows_px = 0;
  TargetCamera camera;  // estimated from all views
  double rms_px = 0;    // of the corners
  struct Frame {
    std::vector<Eigen::Vector2d> corners_px;  // empty: not found
    Eigen::VectorXd pose;                     // MotionOf, middle of the corners to camera
    std::string because;
  };
  std::vector<Frame> frames;
};

// Starts the program installed beside this one. NOT_FOUND if it is missing, with advice on how to
// install it. INVALID_ARGUMENT names an image and the reason. INTERNAL if the program failed.
absl::StatusOr<FoundTargets> FindTargets(const std::vector<std::string>& images,
                                         const TargetBoard& board);

}  // namespace sightline
