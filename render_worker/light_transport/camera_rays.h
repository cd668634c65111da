// SPDX-License-Identifier: Apache-2.0
// Rays of the thin-lens camera.
#pragma once

#include <Eigen/Core>

#include "render_worker/light_transport/light_transport.h"

namespace sightline {

// Undistorted normalised image coordinates that Brown and Conrady's model maps to `distorted`;
// Newton's method, exact to rounding where the model is one to one.
Eigen::Vector2d Undistort(const Distortion& distortion, const Eigen::Vector2d& distorted);

class CameraRays {
 public:
  explicit CameraRays(const SceneView& view);

  const Eigen::Vector3d& origin_m() const { return origin_m_; }
  // Chief ray through sensor position (u, v) [m], in part coordinates. Its component along the
  // optical axis is 1, so that ray parameters are depths.
  Eigen::Vector3d ChiefDirection(double u_m, double v_m) const;

  // Ray through a point of the pupil, given by (u1, u2) in [0, 1)^2, to the point where the chief
  // ray meets the focused plane.
  struct Ray {
    Eigen::Vector3f origin_m;
    Eigen::Vector3f direction;
    float depth_m;  // along the optical axis, per length of the direction
  };
  Ray PupilRay(double u_m, double v_m, float u1, float u2) const;

 private:
  Eigen::Vector3d origin_m_, x_axis_, y_axis_, z_axis_;
  // Focus distance of the lens at a position on the sensor [m].
  double FocusDistance(double u_m, double v_m) const;

  double image_distance_m_, focus_distance_m_, pupil_radius_m_;
  double slope_u_, slope_v_;
  Distortion distortion_;
  bool distorted_;
};

}  // namespace sightline
