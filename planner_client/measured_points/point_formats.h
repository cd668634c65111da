// SPDX-License-Identifier: Apache-2.0
// Readers of single formats, for ReadMeasuredPoints.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "planner_client/measured_points/read_points.h"

namespace sightline {

// Points of a PCD file of version 0.7 in ASCII, binary or binary_compressed, with the fields x, y,
// z and optionally normal_x, normal_y, normal_z, all of type F. Points with a coordinate that is
// not finite are counted as without value: organised clouds mark unmeasured pixels so. `bytes`:
// content of the file. The message of an error is only the reason.
absl::StatusOr<MeasuredPoints> ReadPcd(std::string_view bytes, int64_t most_points);

// Profiles as text. The first line names the columns, among them stage, x and z with
// units as in `stage_mm,x_mm,z_mm` (m, mm, um or inch); other columns are ignored.
// Decimal and separating signs as in core/text/number_table.h. `path` begins every
// message.
absl::StatusOr<MeasuredPoints> ReadProfileCsv(std::string_view text, const std::string& path,
                                              const PointFileFrame& frame, int64_t most_points);

// A depth raster (v1::DepthRaster) and its description in a .json file of the same name. Messages
// begin with the file that is wrong.
absl::StatusOr<MeasuredPoints> ReadDepthRaster(const std::string& path, const PointFileFrame& frame,
                                               int64_t most_points);

}  // namespace sightline
