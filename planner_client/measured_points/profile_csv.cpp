// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/part/mesh_readers.h"
#include "core/status/status_macros.h"
#include "core/text/length_unit.h"
#include "core/text/number_table.h"
#include "planner_client/measured_points/point_formats.h"

namespace sightline {
namespace {

struct ProfileColumn {
  int index = -1;
  double metres_per_unit = 1;
};
// stage, x and z.
using ProfileColumns = std::array<ProfileColumn, 3>;
constexpr std::array<const char*, 3> kProfileColumns = {"stage", "x", "z"};

absl::StatusOr<ProfileColumns> FindProfileColumns(std::string_view line, const std::string& path) {
  ProfileColumns columns;
  const std::vector<std::string> names = absl::StrSplit(
      absl::string_view(line.data(), line.size()), absl::ByAnyChar(",;\t "), absl::SkipEmpty());
  for (size_t i = 0; i < names.size(); ++i) {
    const std::string name = absl::AsciiStrToLower(names[i]);
    const size_t underscore = name.rfind('_');
    for (size_t k = 0; k < kProfileColumns.size(); ++k) {
      if (name.substr(0, underscore) != kProfileColumns[k]) continue;
      const std::optional<double> unit = underscore == std::string::npos
                                             ? std::nullopt
                                             : MetresPerUnit(name.substr(underscore + 1));
      if (!unit) {
        return absl::InvalidArgumentError(
            absl::StrCat(path, ": column ", Excerpt(names[i]), " states no unit; write ",
                         kProfileColumns[k], "_mm, _um, _m or _inch"));
      }
      columns[k] = {static_cast<int>(i), *unit};
    }
  }
  for (size_t k = 0; k < kProfileColumns.size(); ++k) {
    if (columns[k].index >= 0) continue;
    return absl::InvalidArgumentError(absl::StrCat(path, ": its first line has no column ",
                                                   kProfileColumns[k],
                                                   "; profiles need stage_mm, x_mm and z_mm"));
  }
  return columns;
}

}  // namespace

absl::StatusOr<MeasuredPoints> ReadProfileCsv(std::string_view text, const std::string& path,
                                              const PointFileFrame& frame, int64_t most_points) {
  if (!frame.laser_at) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": profiles need the pose of the laser, which a plan states"));
  }
  const size_t end = text.find_first_of("\r\n");
  if (end == std::string_view::npos) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": has no points"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto columns, FindProfileColumns(text.substr(0, end), path));
  MeasuredPoints points;
  // Points of one profile share the pose of the laser.
  double stage_m = 0;
  Eigen::Isometry3d laser = frame.laser_at(stage_m);
  const auto row = [&](int line, const std::vector<double>& values) -> absl::Status {
    std::array<double, 3> v{};
    for (size_t k = 0; k < v.size(); ++k) {
      const ProfileColumn& column = columns[k];
      if (column.index >= static_cast<int>(values.size())) {
        return absl::InvalidArgumentError(
            absl::StrCat(path, ": line ", line, " has ", values.size(), " values"));
      }
      v[k] = column.metres_per_unit * values[static_cast<size_t>(column.index)];
    }
    if (static_cast<int64_t>(points.cloud.positions_m.size()) >= most_points) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": has more than ", most_points, " points: thin them out evenly"));
    }
    if (v[0] != stage_m) {
      stage_m = v[0];
      laser = frame.laser_at(stage_m);
    }
    points.cloud.positions_m.push_back(laser * Eigen::Vector3d(v[1], 0, v[2]));
    return absl::OkStatus();
  };
  NumberTableRules rules;
  rules.max_numbers = size_t{1} << 28;
  SIGHTLINE_RETURN_IF_ERROR(ReadNumberTable(text.substr(end), rules, path, {}, row));
  return points;
}

}  // namespace sightline
