// SPDX-License-Identifier: Apache-2.0
// A laser line on a tilted plate, as the camera sees it at one place.
//
// Camera coordinates: x to the right of the image, y down, z forward, in metres. Close to one of
// its points the line looks like a line on a plate perpendicular to the camera's axis (format
// version 1) at the same depth, with another width and brightness. `ObliqueView` has both.
#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "absl/status/statusor.h"
#include "core/scanner_calibration/target_camera.h"

namespace sightline {

// normal . x = offset, |normal| = 1.
struct LaserSheet {
  Eigen::Vector3d normal = Eigen::Vector3d::UnitX();
  double offset_m = 0;
  std::optional<Eigen::Vector3d> origin_m;  // source of the light; unset: far away
};

// Directions at a point of the line, and what a plate perpendicular to the camera's axis lacks.
struct ObliqueView {
  double incidence_angle_rad = 0;  // between the ray of the laser and the plate's normal
  double view_cosine = 1;          // between the ray to the camera and the normal
  double half_normal_cosine = 1;   // between the half vector of both rays and the normal
  double half_ray_cosine = 1;      // between the half vector and either ray
  // Width of the line's image over that of a line with this incidence angle on a plate
  // perpendicular to the axis at this depth.
  double width_factor = 1;
  // Variance of the line's place in the columns of the image about whole pixels [px^2]: the columns
  // of a slanted line are shifted by whole pixels.
  double row_variance_px2 = 0;
};

// The line on one plate.
struct PlateLine {
  Eigen::Vector3d point_m, direction;  // direction: unit vector
  Eigen::Vector3d normal;              // of the plate, towards the camera
  Eigen::Vector3d across;              // unit vector on the plate, perpendicular to the line
};

// `plate_in_camera`: takes points (x, y, 0) of the plate to camera coordinates. INVALID_ARGUMENT,
// without the name of a field: sheet and plate are parallel (within 1 degree), or the camera lies
// in the plane of the plate.
absl::StatusOr<PlateLine> LineOnPlate(const LaserSheet& sheet,
                                      const Eigen::Isometry3d& plate_in_camera);

// A point of the line and its image. `along_columns`: the line runs along the columns of the image.
struct LinePlace {
  Eigen::Vector3d point_m;
  Eigen::Vector2d image_px;  // column and row, pixel centres at whole numbers
};

// The place of the line in the row `along_px` (`along_columns`) or column of the image, by Newton's
// iteration from `start_m`, a point near the line. None: it is behind the camera, or the iteration
// does not converge.
std::optional<LinePlace> PlaceOfLine(const TargetCamera& camera, const PlateLine& line,
                                     bool along_columns, double along_px,
                                     const Eigen::Vector3d& start_m);

// True if the image of the line at this point is steeper than 45 degrees.
bool RunsAlongColumns(const TargetCamera& camera, const PlateLine& line,
                      const Eigen::Vector3d& point_m);

// The view at a point of the line; `row_variance_px2` is left 0. INVALID_ARGUMENT, without the name
// of a field: camera or laser see the plate edge on (within 1 degree) or from behind.
absl::StatusOr<ObliqueView> ViewOfLine(const TargetCamera& camera, const LaserSheet& sheet,
                                       const PlateLine& line, bool along_columns,
                                       const Eigen::Vector3d& point_m);

// Radiance over irradiance [1/sr] of Lambert + GGX (Schlick's Fresnel term, separable masking by
// Smith; Walter et al., EGSR 2007), as docs/recordings.md has it for a view along the normal.
double ObliqueBrdf(double diffuse_albedo, double specular_f0, double ggx_alpha,
                   const ObliqueView& view);

}  // namespace sightline
