// SPDX-License-Identifier: Apache-2.0
#include "planner_client/measured_points/read_points.h"

#include <filesystem>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/file/read_file.h"
#include "core/part/mesh_readers.h"
#include "core/status/status_macros.h"
#include "planner_client/measured_points/point_formats.h"

namespace sightline {
namespace {

std::string SuffixOf(const std::string& path) {
  std::string suffix = std::filesystem::path(path).extension().string();
  if (!suffix.empty()) suffix.erase(0, 1);
  return absl::AsciiStrToLower(suffix);
}

void PutInFrame(const PointFileFrame& frame, PointCloud& cloud) {
  for (Eigen::Vector3d& position : cloud.positions_m) {
    position = frame.pose * (frame.metres_per_unit * position);
  }
  for (Eigen::Vector3d& normal : cloud.normals) normal = frame.pose.linear() * normal;
}

absl::StatusOr<MeasuredPoints> ReadByFormat(const std::string& path, const std::string& suffix,
                                            const PointFileFrame& frame, int64_t most_points) {
  if (suffix == "ply") {
    SIGHTLINE_ASSIGN_OR_RETURN(auto cloud, LoadPoints(path));
    PutInFrame(frame, cloud);
    return MeasuredPoints{std::move(cloud), 0};
  }
  if (suffix == "png" || suffix == "tif" || suffix == "tiff") {
    return ReadDepthRaster(path, frame, most_points);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto bytes, ReadRegularFile(path, kMaxPartFileBytes));
  if (suffix == "csv") return ReadProfileCsv(bytes, path, frame, most_points);
  auto points = ReadPcd(bytes, most_points);
  if (!points.ok()) {
    return absl::Status(points.status().code(),
                        absl::StrCat(path, ": ", points.status().message()));
  }
  PutInFrame(frame, points->cloud);
  return points;
}

}  // namespace

std::vector<std::string> MeasuredPointFormats() {
  return {"ply", "pcd", "csv", "png", "tif", "tiff"};
}

absl::StatusOr<MeasuredPoints> ReadMeasuredPoints(const std::string& path,
                                                  const PointFileFrame& frame,
                                                  int64_t most_points) {
  const std::string suffix = SuffixOf(path);
  if (suffix == "e57") {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": E57 is not read; export the points as PLY or PCD in metres"));
  }
  bool known = false;
  for (const std::string& format : MeasuredPointFormats()) known = known || format == suffix;
  if (!known) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": points are read from ", absl::StrJoin(MeasuredPointFormats(), ", "), " files"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto points, ReadByFormat(path, suffix, frame, most_points));
  const auto count = static_cast<int64_t>(points.cloud.positions_m.size());
  if (count == 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, ": has no points",
        points.without_value > 0 ? absl::StrCat("; ", points.without_value, " have no value")
                                 : ""));
  }
  return points;
}

}  // namespace sightline
