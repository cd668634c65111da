// SPDX-License-Identifier: Apache-2.0
// Pose of the camera on a robot's flange, from poses of the flange and of the target.
//
//   B_k X C_k = P:   B_k flange in the robot's base, X camera in the flange (wanted), C_k target in
//   the camera, P target in the base (wanted), for every frame k.
//
// Rotation from pairs of motions (Park and Martin, IEEE Trans. Robotics and Automation 10(5),
// 1994), then least squares over X and P; the covariance comes from the Jacobian and the residuals,
// so that it includes the robot's own errors.
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct HandEye {
  Eigen::VectorXd camera_in_flange;  // MotionOf: rotation vector [rad], translation [m]
  Eigen::MatrixXd covariance;        // 6 x 6
  // Left over per frame: position of the target's middle [m] and turn [rad].
  std::vector<double> position_m, turn_rad;
  double closure_m = 0, closure_rad = 0;  // root mean squares of them
};

// At least three poses, in the order of the frames. INVALID_ARGUMENT: fewer, or the flange never
// turned about two different axes.
absl::StatusOr<HandEye> FindHandEye(const std::vector<Eigen::Isometry3d>& flange_in_base,
                                    const std::vector<Eigen::Isometry3d>& target_in_camera);

// Length of the target's squares by the robot's movements, over the stated length. A calibration
// without poses cannot see a wrong length: it only makes all distances wrong in proportion.
struct RobotScale {
  double value = 1, standard_error = 0;
};

// Least squares as FindHandEye, with the scale of all target positions free. Errors as FindHandEye.
absl::StatusOr<RobotScale> ScaleByRobot(const std::vector<Eigen::Isometry3d>& flange_in_base,
                                        const std::vector<Eigen::Isometry3d>& target_in_camera);

// A reason why poses do not fit the frames: other poses, made of the given ones by a usual mistake,
// leave less than a third of the closure. Tried: shifted by one frame, backwards, two of them
// exchanged, inverse (base in flange), images mirrored, squares of another size. Empty: none.
std::string WhyPosesDoNotFit(const std::vector<Eigen::Isometry3d>& flange_in_base,
                             const std::vector<Eigen::Isometry3d>& target_in_camera,
                             const std::vector<std::string>& names, double closure_m);

}  // namespace sightline
