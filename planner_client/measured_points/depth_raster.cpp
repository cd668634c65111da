// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <filesystem>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/image/read_raw_image.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planner_client/measured_points/point_formats.h"
#include "sightline/v1/measured_result.pb.h"

namespace sightline {

absl::StatusOr<MeasuredPoints> ReadDepthRaster(const std::string& path, const PointFileFrame& frame,
                                               int64_t most_points) {
  if (!frame.laser_at) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": a depth raster needs the pose of the laser, which a plan states"));
  }
  const std::string description = std::filesystem::path(path).replace_extension(".json").string();
  v1::DepthRaster raster;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(description, &raster));
  for (const auto& [name, value] : {std::pair{"column_pitch_m", raster.column_pitch_m()},
                                    std::pair{"row_pitch_m", raster.row_pitch_m()},
                                    std::pair{"depth_per_count_m", raster.depth_per_count_m()}}) {
    if (std::abs(value) > 0 && std::abs(value) <= 0.1) continue;
    return absl::InvalidArgumentError(absl::StrCat(description, ": ", name, " is ", value,
                                                   ", must be between 0 and 0.1 m in magnitude"));
  }
  const auto image = ReadRawImageFile(path, [&](int columns, int rows) -> absl::Status {
    if (int64_t{columns} * rows <= most_points) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        " has ", int64_t{columns} * rows, " pixels, at most ", most_points, " points can be used"));
  });
  if (!image.ok()) return image.status();
  MeasuredPoints points;
  const auto& counts = image->raw_dn;
  for (int row = 0; row < counts.rows_px; ++row) {
    const Eigen::Isometry3d laser =
        frame.laser_at(raster.first_stage_m() + row * raster.row_pitch_m());
    for (int column = 0; column < counts.columns_px; ++column) {
      const int count = counts.At(row, column);
      if (count == raster.no_value()) {
        ++points.without_value;
        continue;
      }
      points.cloud.positions_m.push_back(
          laser * Eigen::Vector3d(raster.first_x_m() + column * raster.column_pitch_m(), 0,
                                  raster.first_depth_m() + count * raster.depth_per_count_m()));
    }
  }
  return points;
}

}  // namespace sightline
