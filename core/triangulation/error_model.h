// SPDX-License-Identifier: Apache-2.0
// The triangulated point as a function of the error variables, for any number type: doubles give
// the point, Taylor series its derivatives of any order (uncertainty_propagation.cpp).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <type_traits>

#include "core/triangulation/triangulation.h"

namespace sightline {

// Everything of one image position that the errors do not change, in the camera's stated axes.
struct ErrorModel {
  ErrorModel(const TriangulationSetup& setup, const Eigen::Vector2d& image_px) {
    to_camera << setup.camera.x_axis, setup.camera.y_axis, setup.camera.z_axis;
    to_camera.transposeInPlace();
    pupil_m = setup.camera.origin_m;
    source = to_camera * (setup.laser.origin_m - pupil_m);
    sheet_x = to_camera * setup.laser.x_axis;
    sheet_normal = to_camera * setup.laser.y_axis;
    sheet_z = to_camera * setup.laser.z_axis;
    focal_length_px = setup.focal_length_px;
    from_centre_px = image_px - setup.principal_point_px;
  }

  // Viewing ray (x', y', 1) without errors.
  Eigen::Vector3d Ray() const {
    return {from_centre_px.x() / focal_length_px, from_centre_px.y() / focal_length_px, 1};
  }

  Eigen::Matrix3d to_camera;  // axes of the frame of the setup to those of the camera
  Eigen::Vector3d pupil_m;
  Eigen::Vector3d source;  // from the pupil [m]
  Eigen::Vector3d sheet_x, sheet_normal, sheet_z;
  double focal_length_px;
  Eigen::Vector2d from_centre_px;  // image position from the principal point
};

// Factors of a rotation by the angle theta: sin(theta)/theta and (1 - cos(theta))/theta^2 as
// functions of theta^2. The polynomials miss terms in theta^4: below double precision for small
// angles, and beyond the third order of a series about zero.
template <typename T>
std::array<T, 2> RotationFactors(const T& squared_angle) {
  if constexpr (std::is_same_v<T, double>) {
    if (squared_angle > 1e-8) {
      const double angle = std::sqrt(squared_angle);
      const double half = std::sin(0.5 * angle) / angle;
      return {std::sin(angle) / angle, 2 * half * half};
    }
  }
  return {T(1) - squared_angle * (1.0 / 6), T(0.5) - squared_angle * (1.0 / 24)};
}

template <typename T>
struct TriangulatedPoint {
  std::array<T, 3> in_camera;  // from the stated pupil, in the camera's stated axes [m]
  T depth;                     // along the true camera's viewing axis [m]
};

// Meets the ray of the camera with errors with the sheet with errors:
//   r' = R(w) ((x + e_x - c_x - e_cx)/(f + e_f), (y + e_y - c_y - e_cy)/(f + e_f), 1)
//   n' = cos(t) n + sin(t)/t (t_x z - t_z x),   t^2 = t_x^2 + t_z^2  (x, n, z: the laser's axes)
//   X  = p + r' (n' . (s - p) + o) / (n' . r')  (s: the source, p: camera position error)
template <typename T>
TriangulatedPoint<T> TriangulateWithErrors(const ErrorModel& model,
                                           const std::array<T, kTriangulationVariables>& e) {
  const T inverse_f = T(1) / (e[kFocalLengthError] + model.focal_length_px);
  const T u = (e[kImageX] - e[kPrincipalX] + model.from_centre_px.x()) * inverse_f;
  const T v = (e[kImageY] - e[kPrincipalY] + model.from_centre_px.y()) * inverse_f;

  // R(w) k = k + sin(a)/a (w x k) + (1 - cos(a))/a^2 w x (w x k).
  const T& wx = e[kCameraAlpha];
  const T& wy = e[kCameraBeta];
  const T& wz = e[kCameraGamma];
  const auto rotation = RotationFactors<T>(wx * wx + wy * wy + wz * wz);
  const T ax = wy - wz * v, ay = wz * u - wx, az = wx * v - wy * u;
  const std::array<T, 3> ray = {u + rotation[0] * ax + rotation[1] * (wy * az - wz * ay),
                                v + rotation[0] * ay + rotation[1] * (wz * ax - wx * az),
                                T(1) + rotation[0] * az + rotation[1] * (wx * ay - wy * ax)};

  const T& tx = e[kSheetTiltX];
  const T& tz = e[kSheetTiltZ];
  const T squared_tilt = tx * tx + tz * tz;
  const auto tilt = RotationFactors<T>(squared_tilt);
  const T along_normal = T(1) - squared_tilt * tilt[1];
  const T along_z = tilt[0] * tx, along_x = tilt[0] * tz;

  T numerator = e[kSheetOffset], denominator = T(0);
  for (int i = 0; i < 3; ++i) {
    const T normal = along_normal * model.sheet_normal[i] + along_z * model.sheet_z[i] -
                     along_x * model.sheet_x[i];
    numerator = numerator + normal * (T(model.source[i]) - e[kCameraX + i]);
    denominator = denominator + normal * ray[i];
  }
  TriangulatedPoint<T> point;
  point.depth = numerator / denominator;
  for (int i = 0; i < 3; ++i) point.in_camera[i] = e[kCameraX + i] + point.depth * ray[i];
  return point;
}

}  // namespace sightline
