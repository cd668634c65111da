// SPDX-License-Identifier: Apache-2.0
// Points of a scan from a file, by its suffix:
//   .ply         points in the coordinates of the CAD model (core/part/load_part.h)
//   .pcd         likewise (Point Cloud Library, version 0.7)
//   .csv         profiles in the frame of the laser, with the position of the stage
//   .png, .tif   depth raster in the same frame, described by a .json file beside it
//
//   PointFileFrame frame{.metres_per_unit = 1, .laser_at = ...};
//   auto points = ReadMeasuredPoints("scan_01.pcd", frame);
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/part/load_part.h"

namespace sightline {

struct PointFileFrame {
  // Unit of PLY and PCD files, which state none.
  double metres_per_unit = 1;
  // Applied to PLY and PCD points after the unit: x_cad = pose x.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  // x_cad = M x_laser with the stage at a position [m]; the laser's line lies along x, its central
  // ray along z. Needed for CSV and rasters: if null, such files are rejected.
  std::function<Eigen::Isometry3d(double stage_m)> laser_at;
};

struct MeasuredPoints {
  PointCloud cloud;           // CAD coordinates
  int64_t without_value = 0;  // points that the format marks as not measured
};

// Suffixes, without dots and in lower case, that ReadMeasuredPoints accepts.
std::vector<std::string> MeasuredPointFormats();

// Reads at most `most_points` points; if the format states their number, the limit is checked
// before memory is allocated. INVALID_ARGUMENT names the file and the reason: another suffix (E57
// with advice), damage, no points, a coordinate that is not finite if the format has no unmeasured
// points, or too many points. NOT_FOUND: no such file.
absl::StatusOr<MeasuredPoints> ReadMeasuredPoints(const std::string& path,
                                                  const PointFileFrame& frame, int64_t most_points);

}  // namespace sightline
