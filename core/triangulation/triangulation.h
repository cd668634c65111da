// SPDX-License-Identifier: Apache-2.0
// Laser triangulation of points and the effect of 14 error variables (thesis 1.2.1, 3.3, Table
// 3.1; Haralick, Propagating covariance in computer vision, 1996).
//
// A detected point (x, y) of the laser line on the image gives three equations in the point X,
//   M(d) X = q(d):  (v_1 - v_3 (x - c_x)/f) . (X - c) = 0   (image column)
//                   (v_2 - v_3 (y - c_y)/f) . (X - c) = 0   (image row)
//                   n . X = d                               (laser sheet)
// with v_1, v_2, v_3 the camera's axes and c its pupil. (Thesis eq. 1.4 exchanges v_1 and v_3.)
#pragma once

#include <Eigen/Core>
#include <array>
#include <numbers>
#include <string_view>

#include "absl/status/status.h"
#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"

namespace sightline {

// Error variables of Table 3.1, in this order in every vector and matrix of 14.
//
// Both rotations are rotation vectors: the axes are those of the stated pose, the angle is the
// vector's length, and no axis comes first. To first order they are the thesis's angles (eq. 3.8,
// where the axes of alpha and beta are exchanged). The two tilts turn the sheet's normal by
// (tilt_x^2 + tilt_z^2)^1/2, so that the thesis's cone of angle theta and direction phi is
// tilt_x = theta cos(phi), tilt_z = theta sin(phi), exactly.
enum TriangulationVariable {
  kImageX,            // detection, px
  kImageY,            // detection, px
  kCameraAlpha,       // camera rotation about its own x axis, rad; about the pupil
  kCameraBeta,        // about y, rad
  kCameraGamma,       // about z, rad
  kCameraX,           // camera position along its own (stated, not rotated) x axis, m
  kCameraY,           // along y, m
  kCameraZ,           // along z, m
  kSheetTiltX,        // laser sheet turned about the projector's x axis (the line), rad
  kSheetTiltZ,        // about its viewing axis z, rad; both about the source
  kSheetOffset,       // sheet moved along its normal, m
  kFocalLengthError,  // px
  kPrincipalX,        // px
  kPrincipalY,        // px
  kTriangulationVariables
};

// For messages and tables.
inline constexpr std::array<const char*, kTriangulationVariables> kTriangulationVariableNames = {
    "detection x",       "detection y",       "camera rotation x", "camera rotation y",
    "camera rotation z", "camera position x", "camera position y", "camera position z",
    "sheet tilt x",      "sheet tilt z",      "sheet offset",      "focal length",
    "principal point x", "principal point y"};

using TriangulationErrors = Eigen::Matrix<double, kTriangulationVariables, 1>;
using TriangulationCovariance =
    Eigen::Matrix<double, kTriangulationVariables, kTriangulationVariables>;

// Camera and laser of one frame, in the frame in which points are wanted. The sheet passes through
// the laser's origin with the normal laser.y_axis.
struct TriangulationSetup {
  SensorPose camera;
  SensorPose laser;
  double focal_length_px = 1;
  Eigen::Vector2d principal_point_px = Eigen::Vector2d::Zero();
};

// Principal point: image centre, pixel centres at whole numbers plus one half.
TriangulationSetup MakeTriangulationSetup(const Camera& camera, const SensorPose& camera_pose,
                                          const SensorPose& laser_pose);

// Image of a point in front of the camera [px].
Eigen::Vector2d ProjectPoint(const TriangulationSetup& setup, const Eigen::Vector3d& point_m);

// The point [m] that the image position [px] is taken for, when the true setup differs from the
// stated one by `errors` (full rotations, no linearisation). NaN where the ray does not meet the
// sheet in front of the camera.
Eigen::Vector3d Triangulate(const TriangulationSetup& setup, const Eigen::Vector2d& image_px,
                            const TriangulationErrors& errors = TriangulationErrors::Zero());

// Derivatives of the point with respect to the errors at zero [m per unit of each], by the implicit
// function theorem on the squared residual |M X - q|^2 (thesis eq. 3.7, 3.9):
//   dX/de = -M^-1 (dM/de X - dq/de).
// NaN where Triangulate is.
Eigen::Matrix<double, 3, kTriangulationVariables> PointDerivatives(const TriangulationSetup& setup,
                                                                   const Eigen::Vector2d& image_px);

// Derivatives of N . X with respect to the image position (x, y) [m/px], N a unit vector: the part
// of PointDerivatives that a detection error moves along a surface normal.
//
// With depth z and ray r = e_x x' + e_y y' + e_z, x' = (x - c_x)/f, the point is X = c + z r, and
//   dX/dx = z/f e_x + r dz/dx.
// It stays on the sheet, n . dX/dx = 0, so that dz/dx = -z/f (n . e_x)/(n . r) and
//   N . dX/dx = z/f [N . e_x - (N . r)(n . e_x)/(n . r)],   likewise for y with e_y.
// A sheet that contains the direction of the image rows, n . e_x = 0, leaves z/f N . e_x.
//
// `camera`: only its axes are used. `ray`: any multiple of r, for instance X - c. `depth_m`: z. Not
// finite where the ray lies along the sheet.
inline Eigen::Vector2d ImageDerivativesAlong(const Eigen::Vector3d& direction,
                                             const SensorPose& camera, double focal_length_px,
                                             const Eigen::Vector3d& sheet_normal,
                                             const Eigen::Vector3d& ray, double depth_m) {
  const double slope = direction.dot(ray) / sheet_normal.dot(ray);
  return depth_m / focal_length_px *
         Eigen::Vector2d(direction.dot(camera.x_axis) - slope * sheet_normal.dot(camera.x_axis),
                         direction.dot(camera.y_axis) - slope * sheet_normal.dot(camera.y_axis));
}

// Independent standard deviations of all errors, finite and not negative.
struct TriangulationStandardDeviations {
  double detection_x_px = 0;
  double detection_y_px = 0;
  double camera_rotation_rad = 0;  // about each axis
  double camera_position_m = 0;    // along each axis
  // About each of the two axes. A cone of the thesis with half angle sigma (normally distributed
  // angle, every direction alike) has the same covariance as two tilts of sigma / sqrt(2).
  double laser_tilt_rad = 0;
  double laser_offset_m = 0;
  double focal_length_px = 0;
  double principal_point_px = 0;  // in x and in y
};

// Thesis Table 3.2. The laser's 0.01 degrees are the half angle of the cone.
inline constexpr TriangulationStandardDeviations kThesisStandardDeviations = {
    .detection_x_px = 0.2,
    .detection_y_px = 0.2,
    .camera_rotation_rad = 0.01 * std::numbers::pi / 180,
    .camera_position_m = 0.5e-3,
    .laser_tilt_rad = 0.01 * std::numbers::pi / 180 / std::numbers::sqrt2,
    .laser_offset_m = 0.5e-3,
    .focal_length_px = 2,
    .principal_point_px = 0.5};

// Diagonal covariance.
TriangulationCovariance MakeTriangulationCovariance(
    const TriangulationStandardDeviations& standard_deviations);

// Finite, symmetric, variances not negative, positive semidefinite. The last three with a tolerance
// of 1e-9 of the standard deviations concerned, for numbers rounded when written. `field` starts
// the message, which names the entry, its value and what is allowed.
absl::Status CheckTriangulationCovariance(const TriangulationCovariance& covariance,
                                          std::string_view field);

// Largest second_order_difference at which the first order is relied on to 5 %. The difference
// lacks the terms beyond the fourth power: where it is 0.045, that of 1/(a + e) is 0.05. The rest
// is margin.
inline constexpr double kLargestSecondOrderDifference = 0.04;

struct PointUncertainty {
  Eigen::Matrix3d covariance_m2;  // first order: J Sigma J'
  // For Gaussian errors, with all terms up to the fourth power of the standard deviations: mean
  // shift of the point by its second derivatives, 1/2 tr(H_i Sigma), and covariance
  //   J Sigma J' + 1/2 tr(H_i Sigma H_j Sigma) + 1/2 (J_i Sigma t_j' + t_i Sigma J_j'),
  //   t_ja = sum_bc Sigma_bc d^3 X_j / de_a de_b de_c.
  // The last term is of the same power as the one before and mostly larger (three times in 1/x);
  // without it the difference below would come out far too small. Not positive semidefinite where
  // the series is of no use.
  Eigen::Vector3d second_order_shift_m;
  Eigen::Matrix3d second_order_covariance_m2;
  // Largest relative difference of standard deviation, first against second order, along any
  // direction. Directions along which the first order gives less than a thousandth of the largest
  // standard deviation are judged against that thousandth. Infinite where the ray does not meet the
  // sheet, and where the point is so uncertain that it may lie behind the camera, which no
  // derivative tells: depth below three of its standard deviations (a normal distribution cut there
  // loses 1.5 % of its standard deviation, 5 % if cut at two).
  double second_order_difference = 0;
  bool first_order_suffices() const {
    return second_order_difference <= kLargestSecondOrderDifference;
  }
};

// First-order covariance J Sigma J' alone [m^2], as in PointUncertainty; a hundredth of its time.
Eigen::Matrix3d FirstOrderCovariance(const TriangulationSetup& setup,
                                     const Eigen::Vector2d& image_px,
                                     const TriangulationCovariance& covariance);

// `covariance` must be symmetric and positive semidefinite (CheckTriangulationCovariance).
PointUncertainty PropagateUncertainty(const TriangulationSetup& setup,
                                      const Eigen::Vector2d& image_px,
                                      const TriangulationCovariance& covariance);

}  // namespace sightline
