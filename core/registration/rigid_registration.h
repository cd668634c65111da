// SPDX-License-Identifier: Apache-2.0
// Pose of a part from points measured on it: robust registration to the CAD model with the
// covariance of the six parameters, and the directions that the points do not determine.
//
// Points y = M x + e of the part at x, with the motion
//   M x = R (x - c) + c + t,   R = exp([theta]),   c the centre of the model's bounding box.
// Minimised over (theta, t) by iterated closest points, point to plane (Chen and Medioni, Image and
// Vision Computing 10(3), 1992), with Tukey's biweight rho and a prior:
//   sum_i rho(n_i . (M^-1 y_i - p_i)) / s^2 + |theta|^2 / s_theta^2 + |t|^2 / s_t^2,
// p_i the nearest point of the model, n_i the normal there, s the residuals' robust standard
// deviation (1.4826 median |r|), updated in every step. At first the biweight reaches all points;
// its reach narrows step by step. Otherwise a few points that alone determine a direction would
// lose their weight before the part is aligned along it. If the noise of the points is known,
// residuals are in units of its standard deviation along n_i. Once the part is nearly aligned,
// points that noise may have moved from another face are left out: their nearest surface may be
// wrong, and near edges all these errors have the same sign. Surfaces that deviate from the model,
// clamps and stray points lose their weight.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/registration/surface_index.h"

namespace sightline {

using PoseVector =
    Eigen::Matrix<double, 6, 1>;  // theta_x, theta_y, theta_z [rad], t_x, t_y, t_z [m]
using PoseCovariance = Eigen::Matrix<double, 6, 6>;

// Before any point, for each of the three: independent, zero mean.
struct PosePrior {
  double rotation_standard_deviation_rad = 0.05;
  double translation_standard_deviation_m = 0.005;
  // Standard deviations of (theta, t).
  PoseVector StandardDeviations() const;
};

// M x_cad = x_supposed.
struct PartPose {
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  PoseVector parameters = PoseVector::Zero();

  Eigen::Matrix3d Rotation() const;
  Eigen::Isometry3d Matrix() const;
};

// A direction in the space of poses, of length 1 in units of the prior's standard deviations.
struct PoseDirection {
  PoseVector direction;  // rad and m
  // Posterior over prior standard deviation along it, in [0, 1]; 1: the points are uninformative.
  double standard_deviation_relative = 1;
};

struct Registration {
  PartPose pose;
  PoseCovariance covariance = PoseCovariance::Zero();
  // Principal directions of the posterior relative to the prior, the worst known first.
  std::vector<PoseDirection> directions;
  // The points do not determine the first so many of `directions`: more than half of the prior's
  // standard deviation is left.
  int not_fixed = 0;
  double residual_standard_deviation_m = 0;  // robust, of the residuals in metres
  int64_t points = 0;                        // that were near enough to the model to take part
  int iterations = 0;
  bool converged = false;  // the last step moved no point of the part by more than 1e-3 of that
};

struct RegistrationOptions {
  PosePrior prior;
  double reach_m = 0.03;     // points farther from the model take no part
  int max_iterations = 100;  // of each of two passes, on a part of the points and on all of them
  // Most points used, chosen evenly.
  size_t most_points = 20'000;
  // Residuals nearer to each other than this may deviate together.
  double correlation_length_m = 0.01;
  // Covariance [m^2] of the noise of the point of that index; null: equal for all and without
  // influence on what face they belong to. One that is not finite leaves the point out.
  std::function<Eigen::Matrix3d(size_t)> noise_m2;
};

// `normals`: of the surface at every point as it was measured, empty or zero if not known; only
// which side of a wall it is counts. The covariance is that of M-estimators (Huber, Robust
// Statistics, 1981, 7.6) with the prior, H^-1 (G + P) H^-1, G from the scores summed over cells of
// the correlation length (Liang and Zeger, Biometrika 73(1), 1986), or over single points where
// that is more: deviations of a surface do not average out like noise. Errors that all points of a
// scan share are not in it. INVALID_ARGUMENT: fewer than 6 points, sizes that do not fit.
// FAILED_PRECONDITION: fewer than 6 points within reach of the model. A registration that did not
// converge, or found a pose that is beside the prior, is for the caller to refuse.
absl::StatusOr<Registration> RegisterPoints(const SurfaceIndex& model,
                                            std::span<const Eigen::Vector3d> points_m,
                                            std::span<const Eigen::Vector3d> normals,
                                            const RegistrationOptions& options);

// Variance [m^2], by the covariance of the pose alone, of where a place of the model (CAD
// coordinates) lies along a unit vector there.
double PoseVariance(const Registration& registration, const Eigen::Vector3d& place_m,
                    const Eigen::Vector3d& direction);

}  // namespace sightline
