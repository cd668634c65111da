// SPDX-License-Identifier: Apache-2.0
#include "tools/target_corners/corner_request.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/field_limits/imaging_limits.h"
#include "core/image/read_raw_image.h"
#include "tools/target_corners/board_corners.h"
#include "tools/target_corners/camera_estimate.h"

namespace sightline {
namespace {

using Json = nlohmann::json;

// Numbers of more than 8 bits are divided down: corners are found in 8 bits.
absl::StatusOr<cv::Mat> ReadGrey(const std::string& path) {
  const auto file = ReadRawImageFile(path, [](int columns_px, int rows_px) {
    if (columns_px <= kImageSize.max && rows_px <= kImageSize.max) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(columns_px, " x ", rows_px, " px, at most ",
                                                   kImageSize.max, " px a side are permitted"));
  });
  if (!file.ok()) return file.status();
  const Image<uint16_t>& raw = file->raw_dn;
  const uint16_t largest = *std::max_element(raw.values.begin(), raw.values.end());
  int shift = 0;
  while ((largest >> shift) > 255) ++shift;
  cv::Mat grey(raw.rows_px, raw.columns_px, CV_8U);
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int column = 0; column < raw.columns_px; ++column) {
      grey.at<uint8_t>(row, column) = static_cast<uint8_t>(raw.At(row, column) >> shift);
    }
  }
  return grey;
}

Json CameraJson(const CameraEstimate& camera) {
  return {{"fx", camera.fx},
          {"fy", camera.fy},
          {"cx", camera.cx},
          {"cy", camera.cy},
          {"distortion", camera.distortion},
          {"rms_px", camera.rms_px}};
}

CameraEstimate CameraOf(const Json& json) {
  CameraEstimate camera;
  camera.fx = json.at("fx").get<double>();
  camera.fy = json.at("fy").get<double>();
  camera.cx = json.at("cx").get<double>();
  camera.cy = json.at("cy").get<double>();
  camera.distortion = json.at("distortion").get<std::array<double, 5>>();
  return camera;
}

}  // namespace

absl::StatusOr<Json> AnswerCornerRequest(const Json& request) try {
  const Checkerboard board{.inner_corners_x = request.at("inner_corners_x").get<int>(),
                           .inner_corners_y = request.at("inner_corners_y").get<int>(),
                           .square_m = request.at("square_m").get<double>()};
  if (board.inner_corners_x < 3 || board.inner_corners_y < 3 || !(board.square_m > 0)) {
    return absl::InvalidArgumentError("the board needs at least 3 x 3 corners and a square size");
  }
  std::vector<BoardCorners> found;
  cv::Size size;
  for (const Json& path : request.at("images")) {
    const auto image = ReadGrey(path.get<std::string>());
    if (!image.ok()) return image.status();
    if (!found.empty() && image->size() != size) {
      return absl::InvalidArgumentError(
          absl::StrCat(path.get<std::string>(), ": ", image->cols, " x ", image->rows,
                       " px, the images before it ", size.width, " x ", size.height));
    }
    size = image->size();
    found.push_back(FindBoardCorners(*image, board));
  }
  CameraEstimate camera;
  if (request.contains("camera")) {
    camera = CameraOf(request.at("camera"));
  } else {
    std::vector<std::vector<cv::Point2f>> views;
    for (const BoardCorners& corners : found) {
      if (!corners.corners_px.empty()) views.push_back(corners.corners_px);
    }
    if (views.size() < 3) {
      return absl::InvalidArgumentError(
          absl::StrCat("the board is seen in ", views.size(),
                       " images; the camera is estimated from at least 3"));
    }
    camera = EstimateCamera(board, size, views);
  }
  Json frames = Json::array();
  for (const BoardCorners& corners : found) {
    Json frame;
    const auto pose =
        corners.corners_px.empty() ? std::nullopt : PoseOfBoard(board, camera, corners.corners_px);
    if (!pose) {
      frame["because"] =
          corners.because.empty() ? "no pose of the board fits its corners" : corners.because;
    } else {
      for (const cv::Point2f& corner : corners.corners_px) {
        frame["corners_px"].push_back({corner.x, corner.y});
      }
      frame["rotation_vector"] = pose->rotation_vector;
      frame["translation_m"] = pose->translation_m;
    }
    frames.push_back(std::move(frame));
  }
  return Json{{"columns_px", size.width},
              {"rows_px", size.height},
              {"camera", CameraJson(camera)},
              {"frames", std::move(frames)}};
} catch (const Json::exception& error) {
  return absl::InvalidArgumentError(absl::StrCat("the request is wrong: ", error.what()));
} catch (const cv::Exception& error) {
  return absl::InternalError(absl::StrCat("OpenCV: ", error.what()));
}

}  // namespace sightline
