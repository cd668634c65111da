// SPDX-License-Identifier: Apache-2.0
#include "core/triangulation/line_shift.h"

#include <cmath>
#include <numbers>

namespace sightline {

using Eigen::Vector3d;

double SheetDeviation_m(const Laser& laser, double axial_distance_m) {
  const double waist_m =
      laser.beam_quality_m2 * laser.wavelength_m / (std::numbers::pi * laser.divergence_rad);
  return 0.5 * std::hypot(waist_m,
                          laser.divergence_rad * (axial_distance_m - laser.beam_focus_distance_m));
}

LineShift LineShiftOnSurface(const TriangulationSetup& setup, const Vector3d& position_m,
                             const Vector3d& normal, const Eigen::Matrix3d& hessian_per_m,
                             double sheet_deviation_m) {
  // In units of f pixels along the column.
  const Vector3d from_pupil = position_m - setup.camera.origin_m;
  const double depth_m = setup.camera.z_axis.dot(from_pupil);
  const Vector3d ray = from_pupil / depth_m;
  const Vector3d& along = setup.camera.y_axis;
  const Vector3d& sheet = setup.laser.y_axis;
  const double depth1_m = -depth_m * normal.dot(along) / normal.dot(ray);
  const Vector3d first_m = depth1_m * ray + depth_m * along;
  const double depth2_m =
      -(first_m.dot(hessian_per_m * first_m) + 2 * depth1_m * normal.dot(along)) / normal.dot(ray);
  const Vector3d second_m = depth2_m * ray + 2 * depth1_m * along;
  const double q1_m = sheet.dot(first_m), q2_m = sheet.dot(second_m);
  const Vector3d light = position_m - setup.laser.origin_m;
  const double brightening = light.dot(hessian_per_m * first_m) / light.dot(normal);
  const double variance = std::pow(sheet_deviation_m / q1_m, 2);
  const auto shift_px = [&](double weight) {
    return setup.focal_length_px * variance * (brightening - weight * q2_m / q1_m);
  };
  return {shift_px(1.5), shift_px(0.75)};
}

}  // namespace sightline
