// SPDX-License-Identifier: Apache-2.0
#include "core/plate_line/plate_line.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace sightline {
namespace {

// Sine or cosine of an angle of 1 degree from the limit.
constexpr double kOneDegree = 0.0174524064;
constexpr double kDifference_m = 1e-6;  // of numerical derivatives of the projection

// Derivative of the image along a direction at a point [px/m].
Eigen::Vector2d ImageOf(const TargetCamera& camera, const Eigen::Vector3d& point_m,
                        const Eigen::Vector3d& direction) {
  const Eigen::Vector3d step = kDifference_m * direction;
  return (camera.Project(point_m + step) - camera.Project(point_m - step)) / (2 * kDifference_m);
}

// Column and row in the order: along the line's axis of the image, across it.
Eigen::Vector2d AlongAcross(const Eigen::Vector2d& column_row, bool along_columns) {
  return along_columns ? Eigen::Vector2d(column_row.y(), column_row.x()) : column_row;
}

}  // namespace

absl::StatusOr<PlateLine> LineOnPlate(const LaserSheet& sheet,
                                      const Eigen::Isometry3d& plate_in_camera) {
  Eigen::Vector3d normal = plate_in_camera.linear().col(2);
  const double distance_m = normal.dot(plate_in_camera.translation());
  if (distance_m > 0) normal = -normal;  // the camera is on the other side
  const Eigen::Vector3d cross = sheet.normal.cross(normal);
  if (cross.norm() < kOneDegree) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "the plate is parallel to the laser plane within %.2f degrees: they have no line in common",
        std::asin(cross.norm()) * 180 / std::numbers::pi));
  }
  if (std::abs(distance_m) < kOneDegree * plate_in_camera.translation().norm()) {
    return absl::InvalidArgumentError(
        "the camera lies in the plane of the plate, which it sees edge on");
  }
  // The point of both planes that is nearest to the camera: a combination of the normals.
  const double c = sheet.normal.dot(normal), plate_offset_m = -std::abs(distance_m);
  const double a = (sheet.offset_m - c * plate_offset_m) / (1 - c * c);
  const double b = (plate_offset_m - c * sheet.offset_m) / (1 - c * c);
  PlateLine line;
  line.point_m = a * sheet.normal + b * normal;
  line.direction = cross.normalized();
  line.normal = normal;
  line.across = normal.cross(line.direction);
  return line;
}

std::optional<LinePlace> PlaceOfLine(const TargetCamera& camera, const PlateLine& line,
                                     bool along_columns, double along_px,
                                     const Eigen::Vector3d& start_m) {
  constexpr int kSteps = 30;
  constexpr double kConverged_px = 1e-6;
  double t = line.direction.dot(start_m - line.point_m);
  for (int i = 0; i < kSteps; ++i) {
    const Eigen::Vector3d point = line.point_m + t * line.direction;
    if (!(point.z() > 0)) return std::nullopt;
    const Eigen::Vector2d image = camera.Project(point);
    const double off = along_px - AlongAcross(image, along_columns).x();
    if (!std::isfinite(off)) return std::nullopt;
    if (std::abs(off) < kConverged_px) return LinePlace{point, image};
    const double slope = AlongAcross(ImageOf(camera, point, line.direction), along_columns).x();
    if (slope == 0) return std::nullopt;
    // Steps are bounded, so that an iteration far from the image does not leave it for good.
    const double limit_m = 0.5 * point.z();
    t += std::clamp(off / slope, -limit_m, limit_m);
  }
  return std::nullopt;
}

bool RunsAlongColumns(const TargetCamera& camera, const PlateLine& line,
                      const Eigen::Vector3d& point_m) {
  const Eigen::Vector2d image = ImageOf(camera, point_m, line.direction);
  return std::abs(image.y()) > std::abs(image.x());
}

absl::StatusOr<ObliqueView> ViewOfLine(const TargetCamera& camera, const LaserSheet& sheet,
                                       const PlateLine& line, bool along_columns,
                                       const Eigen::Vector3d& point_m) {
  // Light from far away comes as steeply as the laser plane allows.
  const Eigen::Vector3d& n = sheet.normal;
  const Eigen::Vector3d to_laser = (sheet.origin_m ? (*sheet.origin_m - point_m).eval()
                                                   : (line.normal - n.dot(line.normal) * n).eval())
                                       .normalized();
  const Eigen::Vector3d to_camera = -point_m.normalized();
  const double incidence_cosine = to_laser.dot(line.normal);
  ObliqueView view;
  view.view_cosine = to_camera.dot(line.normal);
  if (incidence_cosine < kOneDegree) {
    return absl::InvalidArgumentError(
        "the laser lights the plate from behind or along its surface");
  }
  if (view.view_cosine < kOneDegree) {
    return absl::InvalidArgumentError("the camera sees the plate along its surface");
  }
  const Eigen::Vector3d half = (to_laser + to_camera).normalized();
  view.incidence_angle_rad = std::acos(std::min(1.0, incidence_cosine));
  view.half_normal_cosine = half.dot(line.normal);
  view.half_ray_cosine = half.dot(to_camera);
  // A step s across the line moves its image, at a fixed place along the image, by rho s. A plate
  // perpendicular to the axis has f/z instead of rho [px/m].
  const Eigen::Vector2d across = AlongAcross(ImageOf(camera, point_m, line.across), along_columns);
  const Eigen::Vector2d along =
      AlongAcross(ImageOf(camera, point_m, line.direction), along_columns);
  const double rho = std::abs(across.y() - across.x() * along.y() / along.x());
  const double px_per_m = 0.5 * (camera.fx + camera.fy) / point_m.z();
  // Distance from the sheet over that on the plate, across the line.
  const double sheet_cosine = std::abs(n.dot(line.across));
  view.width_factor = incidence_cosine * rho / (px_per_m * sheet_cosine);
  return view;
}

double ObliqueBrdf(double diffuse_albedo, double specular_f0, double ggx_alpha,
                   const ObliqueView& view) {
  using std::numbers::pi;
  const double incidence_cosine = std::cos(view.incidence_angle_rad);
  const double alpha2 = ggx_alpha * ggx_alpha;
  const double base = view.half_normal_cosine * view.half_normal_cosine * (alpha2 - 1) + 1;
  const double distribution = alpha2 / (pi * base * base);
  const double fresnel = specular_f0 + (1 - specular_f0) * std::pow(1 - view.half_ray_cosine, 5);
  const auto masking = [alpha2](double cosine) {
    const double tangent2 = 1 / (cosine * cosine) - 1;
    return 2 / (1 + std::sqrt(1 + alpha2 * tangent2));
  };
  return diffuse_albedo / pi + distribution * fresnel * masking(incidence_cosine) *
                                   masking(view.view_cosine) /
                                   (4 * incidence_cosine * view.view_cosine);
}

}  // namespace sightline
