// SPDX-License-Identifier: Apache-2.0
// Camera from views of a checkerboard (Zhang, IEEE PAMI 22(11), 2000, by cv::calibrateCamera), and
// where the board is in each view.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "tools/target_corners/board_corners.h"

namespace sightline {

// Pinhole with distortion in OpenCV's order and pixel coordinates.
struct CameraEstimate {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 5> distortion{};  // k1, k2, p1, p2, k3
  double rms_px = 0;                   // of the corners about the model
};

// From at least three views. Estimates fx, fy, cx, cy, k1, k2, p1 and p2; k3 stays 0.
CameraEstimate EstimateCamera(const Checkerboard& board, cv::Size image_size,
                              const std::vector<std::vector<cv::Point2f>>& views);

struct BoardPose {
  std::array<double, 3> rotation_vector{};  // board to camera [rad]
  std::array<double, 3> translation_m{};
};

// Pose of the board in one view; none if cv::solvePnP finds none.
std::optional<BoardPose> PoseOfBoard(const Checkerboard& board, const CameraEstimate& camera,
                                     const std::vector<cv::Point2f>& corners_px);

}  // namespace sightline
