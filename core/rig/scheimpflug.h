// SPDX-License-Identifier: Apache-2.0
// Sensor tilt that brings a plane into focus (T. Scheimpflug, GB patent 1196, 1904).
#pragma once

#include <Eigen/Core>
#include <optional>

namespace sightline {

// A sensor plane behind a thin lens. In the lens's frame (origin at the pupil, z along the viewing
// direction; image coordinates u along x, v along y, upright) a place (u, v) of the sensor has the
// image distance
//   b(u, v) = image_distance_m + slope_u u + slope_v v.
struct SensorPlane {
  double image_distance_m = 0;
  double slope_u = 0;  // tangent of the turn about the columns' direction
  double slope_v = 0;  // tangent of the turn about the rows' direction
};

// 1/b [1/m] on the chief ray through (u, v) of the perpendicular sensor at image_distance_m = b_0,
// whose coordinates images have: that ray meets the tilted sensor at (u, v) b/b_0, so b = b_0 +
// (slope . (u, v)) b/b_0 and 1/b = 1/b_0 - slope . (u, v)/b_0^2.
double SensorVergence(const SensorPlane& plane, double u_m, double v_m);

// The sensor plane on which a thin lens of focal length f images every point of the plane
// normal . x = offset sharply. A point (x, y, z) has its image at u = b x/z, v = b y/z with
// 1/b = 1/f - 1/z; put into normal . (u, v, b) z/b = offset this is linear in u, v, b:
//   b = (offset + n_x u + n_y v) / (offset/f - n_z).
// So lens, object plane and sensor meet in one line. Empty if the plane contains the lens's centre
// or its sharp image is at infinity or behind the object's side (b <= f on the axis).
std::optional<SensorPlane> ScheimpflugPlane(const Eigen::Vector3d& normal, double offset_m,
                                            double focal_length_m);

}  // namespace sightline
