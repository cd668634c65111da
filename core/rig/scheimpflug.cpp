// SPDX-License-Identifier: Apache-2.0
#include "core/rig/scheimpflug.h"

#include <cmath>

namespace sightline {

double SensorVergence(const SensorPlane& plane, double u_m, double v_m) {
  const double b = plane.image_distance_m;
  return 1 / b - (plane.slope_u * u_m + plane.slope_v * v_m) / (b * b);
}

std::optional<SensorPlane> ScheimpflugPlane(const Eigen::Vector3d& normal, double offset_m,
                                            double focal_length_m) {
  // On the axis the plane is at z = offset/n_z, so b = 1/(1/f - n_z/offset).
  const double denominator = offset_m / focal_length_m - normal.z();
  if (!(std::abs(offset_m) > 1e-9 * focal_length_m) || denominator == 0) return std::nullopt;
  const SensorPlane plane{offset_m / denominator, normal.x() / denominator,
                          normal.y() / denominator};
  if (!(plane.image_distance_m > focal_length_m) || !std::isfinite(plane.image_distance_m)) {
    return std::nullopt;
  }
  return plane;
}

}  // namespace sightline
