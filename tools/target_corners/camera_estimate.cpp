// SPDX-License-Identifier: Apache-2.0
#include "tools/target_corners/camera_estimate.h"

#include <opencv2/calib3d.hpp>

namespace sightline {

CameraEstimate EstimateCamera(const Checkerboard& board, cv::Size image_size,
                              const std::vector<std::vector<cv::Point2f>>& views) {
  const std::vector<std::vector<cv::Point3f>> points(views.size(), board.PointsM());
  cv::Mat matrix, distortion;
  std::vector<cv::Mat> rotations, translations;
  CameraEstimate camera;
  camera.rms_px = cv::calibrateCamera(points, views, image_size, matrix, distortion, rotations,
                                      translations, cv::CALIB_FIX_K3);
  camera.fx = matrix.at<double>(0, 0);
  camera.fy = matrix.at<double>(1, 1);
  camera.cx = matrix.at<double>(0, 2);
  camera.cy = matrix.at<double>(1, 2);
  for (int i = 0; i < 5; ++i) {
    camera.distortion[static_cast<size_t>(i)] = distortion.at<double>(i);
  }
  return camera;
}

std::optional<BoardPose> PoseOfBoard(const Checkerboard& board, const CameraEstimate& camera,
                                     const std::vector<cv::Point2f>& corners_px) {
  const cv::Matx33d matrix(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  const cv::Mat distortion(1, 5, CV_64F, const_cast<double*>(camera.distortion.data()));
  cv::Mat rotation, translation;
  if (!cv::solvePnP(board.PointsM(), corners_px, matrix, distortion, rotation, translation)) {
    return std::nullopt;
  }
  BoardPose pose;
  for (int i = 0; i < 3; ++i) {
    pose.rotation_vector[static_cast<size_t>(i)] = rotation.at<double>(i);
    pose.translation_m[static_cast<size_t>(i)] = translation.at<double>(i);
  }
  return pose;
}

}  // namespace sightline
