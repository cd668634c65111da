// SPDX-License-Identifier: Apache-2.0
// Camera and target of a calibration as functions of their parameters.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>

namespace sightline {

// Pinhole with Brown-Conrady distortion, pixel centres at whole numbers (as OpenCV has it). Camera
// coordinates: x to the right, y down, z forward.
struct TargetCamera {
  double fx = 1, fy = 1, cx = 0, cy = 0;
  std::array<double, 5> distortion{};  // k1, k2, p1, p2, k3

  Eigen::Vector2d Distorted(const Eigen::Vector2d& p) const {
    const auto& [k1, k2, p1, p2, k3] = distortion;
    const double r2 = p.squaredNorm(), xy = p.x() * p.y();
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    return {p.x() * radial + 2 * p1 * xy + p2 * (r2 + 2 * p.x() * p.x()),
            p.y() * radial + p1 * (r2 + 2 * p.y() * p.y()) + 2 * p2 * xy};
  }
  // Image of a point in front of the camera [px].
  Eigen::Vector2d Project(const Eigen::Vector3d& point_m) const {
    const Eigen::Vector2d p = Distorted({point_m.x() / point_m.z(), point_m.y() / point_m.z()});
    return {fx * p.x() + cx, fy * p.y() + cy};
  }
  // Viewing ray (x', y', 1): the distortion is undone by fixed-point iteration.
  Eigen::Vector3d Ray(const Eigen::Vector2d& image_px) const {
    const Eigen::Vector2d wanted((image_px.x() - cx) / fx, (image_px.y() - cy) / fy);
    Eigen::Vector2d p = wanted;
    for (int i = 0; i < 12; ++i) p += wanted - Distorted(p);
    return {p.x(), p.y(), 1};
  }
};

// A rigid motion as a rotation vector [rad] and a translation [m].
inline Eigen::Isometry3d MotionOf(const Eigen::Ref<const Eigen::VectorXd>& six) {
  const Eigen::Vector3d turn = six.head<3>();
  const double angle = turn.norm();
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  if (angle > 0) motion.linear() = Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  motion.translation() = six.tail<3>();
  return motion;
}
inline Eigen::Vector3d RotationVector(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

// Parameters of camera, laser plane and target that all frames share.
//
// The laser plane is q . x = 1 in camera coordinates, q in 1/m: its normal over its distance from
// the camera. The target's surface is z = xx x^2 + xy x y + yy y^2 [1/m] about the middle of its
// corners: a plate that is bent or twisted a little.
enum SharedParameter {
  kFocalX,
  kFocalY,
  kCentreX,
  kCentreY,
  kRadial1,
  kRadial2,
  kTangential1,
  kTangential2,
  kRadial3,
  kPlaneX,
  kPlaneY,
  kPlaneZ,
  kBendXx,
  kBendXy,
  kBendYy,
  kSharedParameters
};

inline TargetCamera CameraOf(const Eigen::VectorXd& shared) {
  return {.fx = shared[kFocalX],
          .fy = shared[kFocalY],
          .cx = shared[kCentreX],
          .cy = shared[kCentreY],
          .distortion = {shared[kRadial1], shared[kRadial2], shared[kTangential1],
                         shared[kTangential2], shared[kRadial3]}};
}

}  // namespace sightline
