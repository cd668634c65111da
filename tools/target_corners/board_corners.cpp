// SPDX-License-Identifier: Apache-2.0
#include "tools/target_corners/board_corners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace sightline {
namespace {

// The grey value below which a fraction of the pixels lies.
int Quantile(const cv::Mat& image, double fraction) {
  std::array<int64_t, 256> count{};
  for (int row = 0; row < image.rows; ++row) {
    const uint8_t* values = image.ptr<uint8_t>(row);
    for (int column = 0; column < image.cols; ++column) ++count[values[column]];
  }
  const double wanted = fraction * static_cast<double>(image.total());
  double sum = 0;
  for (int level = 0; level < 256; ++level) {
    sum += static_cast<double>(count[static_cast<size_t>(level)]);
    if (sum >= wanted) return level;
  }
  return 255;
}

// The image with values from `level` on cut off, stretched to 8 bits.
cv::Mat CutAt(const cv::Mat& image, int level) {
  cv::Mat cut;
  cv::min(image, level, cut);
  cut.convertTo(cut, CV_8U, 255.0 / std::max(1, level));
  return cut;
}

bool FindCorners(const cv::Mat& image, cv::Size size, std::vector<cv::Point2f>* corners) {
  constexpr int kClassic = cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE;
  if (cv::findChessboardCorners(image, size, *corners, kClassic)) return true;
  return cv::findChessboardCornersSB(image, size, *corners,
                                     cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE);
}

float LeastSpacing(const std::vector<cv::Point2f>& corners, int columns) {
  float least = 1e9F;
  for (size_t i = 1; i < corners.size(); ++i) {
    if (i % static_cast<size_t>(columns) == 0) continue;
    const cv::Point2f step = corners[i] - corners[i - 1];
    least = std::min(least, std::hypot(step.x, step.y));
  }
  return least;
}

// Mean grey values of the squares between four corners, by the parity of column and row.
std::array<double, 2> SquareBrightness(const cv::Mat& image, const Checkerboard& board,
                                       const std::vector<cv::Point2f>& corners) {
  std::array<double, 2> sum{}, count{};
  const auto at = [&](int x, int y) {
    return corners[static_cast<size_t>(y) * static_cast<size_t>(board.inner_corners_x) +
                   static_cast<size_t>(x)];
  };
  for (int y = 0; y + 1 < board.inner_corners_y; ++y) {
    for (int x = 0; x + 1 < board.inner_corners_x; ++x) {
      const cv::Point2f centre =
          0.25F * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1));
      const int column = std::clamp(cvRound(centre.x), 0, image.cols - 1);
      const int row = std::clamp(cvRound(centre.y), 0, image.rows - 1);
      const auto parity = static_cast<size_t>((x + y) % 2);
      sum[parity] += image.at<uint8_t>(row, column);
      count[parity] += 1;
    }
  }
  return {sum[0] / std::max(1.0, count[0]), sum[1] / std::max(1.0, count[1])};
}

// Puts the corners into the order that FindBoardCorners promises.
void OrderCorners(const cv::Mat& image, const Checkerboard& board,
                  std::vector<cv::Point2f>* corners) {
  const auto columns = static_cast<size_t>(board.inner_corners_x);
  const cv::Point2f along_x = corners->at(columns - 1) - corners->front();
  const cv::Point2f along_y = corners->at(corners->size() - columns) - corners->front();
  if (along_x.cross(along_y) < 0) {
    for (size_t row = 0; row < corners->size(); row += columns) {
      const auto begin = corners->begin() + static_cast<std::ptrdiff_t>(row);
      std::reverse(begin, begin + static_cast<std::ptrdiff_t>(columns));
    }
  }
  const bool half_turn_shows = (board.inner_corners_x + board.inner_corners_y) % 2 == 1;
  const std::array<double, 2> brightness = SquareBrightness(image, board, *corners);
  const bool turn = half_turn_shows ? brightness[0] > brightness[1]
                                    : corners->at(columns - 1).x < corners->front().x;
  if (turn) std::reverse(corners->begin(), corners->end());
}

}  // namespace

std::vector<cv::Point3f> Checkerboard::PointsM() const {
  std::vector<cv::Point3f> points;
  for (int y = 0; y < inner_corners_y; ++y) {
    for (int x = 0; x < inner_corners_x; ++x) {
      points.emplace_back(static_cast<float>(x * square_m), static_cast<float>(y * square_m), 0.F);
    }
  }
  return points;
}

BoardCorners FindBoardCorners(const cv::Mat& image, const Checkerboard& board) {
  const cv::Size size(board.inner_corners_x, board.inner_corners_y);
  BoardCorners found;
  // Quantiles that cut the line off (it covers a few per cent), from wide to narrow.
  for (const double fraction : {0.9, 0.8, 0.95, 0.6, 1.0}) {
    const cv::Mat cut = CutAt(image, std::max(8, Quantile(image, fraction)));
    if (!FindCorners(cut, size, &found.corners_px)) continue;
    const int half_window =
        std::clamp(static_cast<int>(0.25F * LeastSpacing(found.corners_px, size.width)), 3, 15);
    cv::cornerSubPix(cut, found.corners_px, {half_window, half_window}, {-1, -1},
                     cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-4));
    OrderCorners(cut, board, &found.corners_px);
    return found;
  }
  found.corners_px.clear();
  found.because = "no board of " + std::to_string(size.width) + " x " +
                  std::to_string(size.height) + " inner corners is seen whole";
  return found;
}

}  // namespace sightline
