// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/camera_rays.h"

#include <cmath>
#include <numbers>

#include "core/rig/scheimpflug.h"

namespace sightline {

Eigen::Vector2d Undistort(const Distortion& d, const Eigen::Vector2d& distorted) {
  Eigen::Vector2d p = distorted;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
    const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
    const double slope = 2 * (d.k1 + r2 * (2 * d.k2 + 3 * r2 * d.k3));  // of radial by r^2, twice
    const Eigen::Vector2d value(x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x),
                                y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y);
    Eigen::Matrix2d jacobian;
    jacobian(0, 0) = radial + x * x * slope + 2 * d.p1 * y + 6 * d.p2 * x;
    jacobian(0, 1) = x * y * slope + 2 * d.p1 * x + 2 * d.p2 * y;
    jacobian(1, 0) = jacobian(0, 1);
    jacobian(1, 1) = radial + y * y * slope + 6 * d.p1 * y + 2 * d.p2 * x;
    const Eigen::Vector2d step = jacobian.inverse() * (value - distorted);
    p -= step;
    if (step.squaredNorm() < 1e-30) break;
  }
  return p;
}

CameraRays::CameraRays(const SceneView& view)
    : origin_m_(view.camera.origin_m),
      x_axis_(view.camera.x_axis),
      y_axis_(view.camera.y_axis),
      z_axis_(view.camera.z_axis),
      image_distance_m_(view.image_distance_m),
      focus_distance_m_(view.focus_distance_m),
      pupil_radius_m_(view.pupil_radius_m),
      slope_u_(view.sensor_slope_u),
      slope_v_(view.sensor_slope_v),
      distortion_(view.distortion),
      distorted_(!(view.distortion == Distortion())) {}

Eigen::Vector3d CameraRays::ChiefDirection(double u_m, double v_m) const {
  Eigen::Vector2d p(u_m / image_distance_m_, v_m / image_distance_m_);
  if (distorted_) p = Undistort(distortion_, p);
  return p.x() * x_axis_ + p.y() * y_axis_ + z_axis_;
}

double CameraRays::FocusDistance(double u_m, double v_m) const {
  if (slope_u_ == 0 && slope_v_ == 0) return focus_distance_m_;
  // 1/d = 1/f - 1/b with 1/f = 1/d_0 + 1/b_0. The calibrated image distance replaces b_0; both
  // differ by parts in a thousand.
  const double vergence = 1 / focus_distance_m_ + 1 / image_distance_m_ -
                          SensorVergence({image_distance_m_, slope_u_, slope_v_}, u_m, v_m);
  // Beyond infinity nothing is in focus: the farthest that rays can be aimed at.
  constexpr double kFarthest_m = 1e6;
  return vergence * kFarthest_m > 1 ? 1 / vergence : kFarthest_m;
}

CameraRays::Ray CameraRays::PupilRay(double u_m, double v_m, float u1, float u2) const {
  const Eigen::Vector3d chief = ChiefDirection(u_m, v_m);
  if (pupil_radius_m_ <= 0) return {origin_m_.cast<float>(), chief.cast<float>(), 1};
  const double radius = pupil_radius_m_ * std::sqrt(static_cast<double>(u1));
  const double angle = 2 * std::numbers::pi * u2;
  const Eigen::Vector3d offset = radius * (std::cos(angle) * x_axis_ + std::sin(angle) * y_axis_);
  const double focus_m = FocusDistance(u_m, v_m);
  return {(origin_m_ + offset).cast<float>(), (focus_m * chief - offset).cast<float>(),
          static_cast<float>(focus_m)};
}

}  // namespace sightline
