// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/posed_plates.h"

#include <cmath>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"

namespace sightline {
namespace {

constexpr Limits kFocalLength_px{10, 1e6, " px", true};
constexpr Limits kOffset{-100, 100, " m"};
// Six digits of a matrix are a rotation within 2e-6.
constexpr double kRotationTolerance = 1e-5, kOffPlane_m = 1e-3;
// Rows or columns that the line must cross: less is no segment.
constexpr int kLeastLength_px = 16;

Eigen::Vector3d VectorOf(const v1::Vector3& v) { return {v.x(), v.y(), v.z()}; }

absl::Status CheckNumber(const Checker& check, const std::string& path, bool given, double value,
                         const Limits& limits) {
  if (!given) return check.Error(path, "is missing");
  return check.Range(path, value, limits);
}

absl::StatusOr<LaserSheet> ParseSheet(const v1::Recordings& message, const Checker& check) {
  if (!message.has_laser_plane()) return check.Error("laser_plane", "is missing");
  const v1::Recordings::LaserPlane& plane = message.laser_plane();
  if (!plane.has_normal()) return check.Error("laser_plane.normal", "is missing");
  const Eigen::Vector3d normal = VectorOf(plane.normal());
  const double length = normal.norm();
  if (!std::isfinite(length) || length < 1e-6) {
    return check.Error("laser_plane.normal",
                       absl::StrCat("has the length ", NumberText(length), ", must be above 1e-6"));
  }
  SIGHTLINE_RETURN_IF_ERROR(CheckNumber(check, "laser_plane.offset_m", plane.has_offset_m(),
                                        plane.offset_m() / length, kOffset));
  LaserSheet sheet{normal / length, plane.offset_m() / length, std::nullopt};
  if (plane.has_origin_m()) {
    sheet.origin_m = VectorOf(plane.origin_m());
    const double off_m = sheet.normal.dot(*sheet.origin_m) - sheet.offset_m;
    if (!(std::abs(off_m) <= kOffPlane_m)) {
      return check.Error(
          "laser_plane.origin_m",
          absl::StrFormat("is %.4g mm off the laser plane, must be in it within 1 mm",
                          1e3 * off_m));
    }
  }
  return sheet;
}

}  // namespace

absl::StatusOr<PosedPlates> ParsePosedPlates(const v1::Recordings& message, const Sensor& sensor,
                                             const Checker& check) {
  if (!message.has_pixel_camera()) return check.Error("pixel_camera", "is missing");
  if (sensor.colour_filter != ColourFilter::kMono) {
    return check.Error("camera.sensor_type",
                       "must be mono in format_version 3: columns of a slanted line are shifted, "
                       "which would mix the colours");
  }
  const v1::Recordings::PixelCamera& c = message.pixel_camera();
  SIGHTLINE_RETURN_IF_ERROR(CheckNumber(check, "pixel_camera.focal_length_px",
                                        c.has_focal_length_px(), c.focal_length_px(),
                                        kFocalLength_px));
  const double columns = sensor.columns_px, rows = sensor.rows_px;
  SIGHTLINE_RETURN_IF_ERROR(CheckNumber(
      check, "pixel_camera.principal_point_column_px", c.has_principal_point_column_px(),
      c.principal_point_column_px(), {-0.5 * columns, 1.5 * columns, " px"}));
  SIGHTLINE_RETURN_IF_ERROR(CheckNumber(check, "pixel_camera.principal_point_row_px",
                                        c.has_principal_point_row_px(), c.principal_point_row_px(),
                                        {-0.5 * rows, 1.5 * rows, " px"}));
  const v1::Lens::Distortion& d = c.distortion();
  for (const auto& [name, value] :
       {std::pair("k1", d.k1()), {"k2", d.k2()}, {"k3", d.k3()}, {"p1", d.p1()}, {"p2", d.p2()}}) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat("pixel_camera.distortion.", name), value, {-10, 10, ""}));
  }
  PosedPlates posed;
  posed.camera = {.fx = c.focal_length_px(),
                  .fy = c.focal_length_px(),
                  .cx = c.principal_point_column_px(),
                  .cy = c.principal_point_row_px(),
                  .distortion = {d.k1(), d.k2(), d.p1(), d.p2(), d.k3()}};
  SIGHTLINE_ASSIGN_OR_RETURN(posed.sheet, ParseSheet(message, check));
  return posed;
}

absl::StatusOr<Eigen::Isometry3d> ParsePlatePose(const v1::Recording::PlatePose& message,
                                                 const std::string& path, const Checker& check) {
  if (message.rotation_size() != 9) {
    return check.Error(path + ".rotation", absl::StrCat("has ", message.rotation_size(),
                                                        " numbers, must have nine: rows of a "
                                                        "rotation matrix"));
  }
  Eigen::Matrix3d rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = message.rotation(i);
  const double off =
      (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off < kRotationTolerance)) {
    return check.Error(path + ".rotation",
                       absl::StrFormat("is no rotation: R R^T differs from 1 by %.3g, must be "
                                       "below %.0e",
                                       off, kRotationTolerance));
  }
  if (rotation.determinant() < 0) {
    return check.Error(path + ".rotation",
                       "has the determinant -1, must be 1: it mirrors the plate");
  }
  if (!message.has_translation_m()) return check.Error(path + ".translation_m", "is missing");
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::Quaterniond(rotation).normalized().toRotationMatrix();
  pose.translation() = VectorOf(message.translation_m());
  if (!(pose.translation().z() > 0 && pose.translation().norm() <= 100)) {
    return check.Error(path + ".translation_m",
                       absl::StrCat("has z = ", NumberText(pose.translation().z()),
                                    ", must be in (0, 100] m: in front of the camera"));
  }
  return pose;
}

absl::StatusOr<LineInRegion> FindLineInRegion(const PosedPlates& posed, const Sensor& sensor,
                                              const RecordedImage& image) {
  LineInRegion found;
  SIGHTLINE_ASSIGN_OR_RETURN(found.line, LineOnPlate(posed.sheet, *image.plate_in_camera));
  const double first_column = sensor.columns_px / 2 + image.roi_column_px;
  const double first_row = sensor.rows_px / 2 + image.roi_row_px;
  const double last_column = first_column + image.roi_columns_px - 1;
  const double last_row = first_row + image.roi_rows_px - 1;
  // The point of the line nearest to what the middle of the region shows of the plate.
  const Eigen::Vector3d ray =
      posed.camera.Ray({0.5 * (first_column + last_column), 0.5 * (first_row + last_row)});
  const double towards = found.line.normal.dot(ray);
  const Eigen::Vector3d middle_m = ray * (found.line.normal.dot(found.line.point_m) / towards);
  found.start_m = found.line.point_m +
                  found.line.direction * found.line.direction.dot(middle_m - found.line.point_m);
  const absl::Status misses = absl::InvalidArgumentError(
      "the line of the laser plane on the plate lies outside of the region of interest");
  if (!(towards < 0) || !(found.start_m.z() > 0)) return misses;
  found.along_columns = RunsAlongColumns(posed.camera, found.line, found.start_m);
  const int first = static_cast<int>(found.along_columns ? first_row : first_column);
  const int last = static_cast<int>(found.along_columns ? last_row : last_column) + 1;
  const double low = found.along_columns ? first_column : first_row;
  const double high = found.along_columns ? last_column : last_row;
  found.first_px = last;
  for (int along = first; along < last; ++along) {
    const auto place =
        PlaceOfLine(posed.camera, found.line, found.along_columns, along, found.start_m);
    if (!place) continue;
    const double across = found.along_columns ? place->image_px.x() : place->image_px.y();
    if (across < low || across > high) continue;
    found.first_px = std::min(found.first_px, along);
    found.last_px = along + 1;
  }
  if (found.last_px - found.first_px < kLeastLength_px) return misses;
  const auto middle = PlaceOfLine(posed.camera, found.line, found.along_columns,
                                  0.5 * (found.first_px + found.last_px), found.start_m);
  if (!middle) return misses;
  found.start_m = middle->point_m;
  SIGHTLINE_RETURN_IF_ERROR(
      ViewOfLine(posed.camera, posed.sheet, found.line, found.along_columns, found.start_m)
          .status());
  return found;
}

absl::Status CheckLineInRegion(const PosedPlates& posed, const Sensor& sensor,
                               const RecordedImage& image, const std::string& path,
                               const Checker& check) {
  const auto found = FindLineInRegion(posed, sensor, image);
  if (found.ok()) return absl::OkStatus();
  return check.Error(path + ".plate_pose",
                     absl::StrCat("does not fit: ", found.status().message()));
}

}  // namespace sightline
