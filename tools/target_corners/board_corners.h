// SPDX-License-Identifier: Apache-2.0
// Inner corners of a checkerboard in an image that a laser line crosses.
//
// The line is clipped and many times brighter than the board, so the image is cut at several levels
// until OpenCV finds the whole board (cv::findChessboardCorners, then its sector-based successor
// cv::findChessboardCornersSB); cv::cornerSubPix refines the corners.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace sightline {

struct Checkerboard {
  int inner_corners_x = 0, inner_corners_y = 0;
  double square_m = 0;

  // Corners on the board [m], row by row, z = 0.
  std::vector<cv::Point3f> PointsM() const;
};

struct BoardCorners {
  // Row by row as Checkerboard::PointsM; pixel centres at whole numbers. Empty: not found.
  std::vector<cv::Point2f> corners_px;
  std::string because;  // why there are none
};

// `image`: one channel of 8 bits. The order is such that x of the board, y of the board and the
// viewing direction are right-handed; of the two such orders, half a turn apart, the one whose
// square between the first four corners is dark. A board with as many dark as bright squares there
// (both numbers of corners odd, or both even) looks the same after half a turn: then the order is
// that in which x points to the right of the image.
BoardCorners FindBoardCorners(const cv::Mat& image, const Checkerboard& board);

}  // namespace sightline
