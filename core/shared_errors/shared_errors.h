// SPDX-License-Identifier: Apache-2.0
// Errors that the estimates of many targets share: those of the calibration, common to all scans
// from one place of the sensors, and those of the registration, common to all scans of one frame.
//
// A *frame* is a coordinate system that scans share, such as those of one set-up. Scan s of frame g
// from place p measures at target t, with unit normal n_t at x_t, the deviation from the model
//   d_ts = h_t + J_ts (c_p + c_0) + a_t xi_g + e_ts,   a_t = ((x_t - c) x n_t, n_t),
// h_t: deviation of the surface; J_ts: derivatives with respect to the calibration variables; c_p:
// errors of camera and laser at place p; c_0: errors of the lens; xi_g: rotation [rad] and shift
// [m] of the part in frame g; e_ts: independent errors. The estimate of h_t weighs the scans by
// w_ts, which sum to one.
//
// Best fit. The poses xi are estimated by least squares over the targets that several frames
// measure, with their prior covariance P (how exactly a part is placed). With the information
// lambda_tg of frame g about target t, and h_t eliminated, the normal matrix is
//   N_gh = sum over t of a_t' (lambda_tg delta_gh - lambda_tg lambda_th / sum_k lambda_tk) a_t.
// The errors that are left are xi - xi^ = -C B c + C^(1/2) z with C = (N + P^-1)^-1: z is standard
// normal, and B the same sums with J in the place of the second a_t, since errors of the
// calibration pull the fit. The coordinate system is the best fit of the joined scans to the model,
// so that a motion of all frames together is no error: with e_t the shared error of the estimate at
// target t, the motion (sum over t of l_t a_t' a_t)^-1 sum over t of l_t a_t' e_t, l_t the
// information of the target, is taken off every xi_g. (Registration of multiple views: Bergevin et
// al., IEEE PAMI 18(5), 1996; covariance of a fit: Censi, An accurate closed-form estimate of ICP's
// covariance, ICRA 2007.)
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/triangulation/calibration_derivatives.h"
#include "core/uncertainty/uncertainty_model.h"

namespace sightline {

// One scan as seen from the targets that it informs about.
struct ScanShare {
  size_t place = 0;  // number of the place of the sensors
  size_t frame = 0;  // number of the frame
  std::vector<uint32_t> targets;
  // One per target. Information about it; only the proportions between scans count.
  std::vector<float> information;
  std::vector<Eigen::Matrix<float, 1, kCalibrationVariables>> derivatives;
};

// Standard deviations of a part's pose about each axis and along each axis.
struct PoseDeviations {
  double angle_rad = 0, position_m = 0;
};

struct SharedErrorsInput {
  std::span<const Eigen::Vector3f> positions_m, normals;  // of all targets
  std::vector<ScanShare> scans;
  // The first nine variables are those of a place, the last three those of the lens.
  CalibrationCovariance calibration = CalibrationCovariance::Zero();
  RegistrationMethod method = RegistrationMethod::kNone;
  // Before registration; with kKnownPoses after it.
  PoseDeviations pose;
  // Variances [m^2] of the independent errors of the targets' estimates; with best fit only.
  std::vector<double> independent_m2;
  // Estimates of targets at distance d correlate by exp(-d^2 / 2 L^2), so neighbours do not count
  // in full. 0: not at all.
  double correlation_length_m = 0;
  // Targets that the best fit uses; empty: all.
  std::vector<bool> used;
};

// How one frame is joined to the others.
struct FrameRegistration {
  // Standard uncertainty along the normals, root mean square over the targets that it measures. The
  // coordinate system is the best fit of the joined scans. If a single frame measures targets that
  // the fit uses, the system is that of this frame, whose own value is then 0.
  double standard_uncertainty_m = 0;
  int64_t targets = 0;
  int64_t overlap_targets = 0;  // another frame measures them, and the fit uses them
  // All six degrees of freedom are known to half of their prior standard deviations at most.
  bool determined = true;
  // False: there are several frames, and the best fit uses no target that this one and another one
  // measure. standard_uncertainty_m then says nothing about how the frame lies to the others.
  bool joined = true;
};

class SharedErrors {
 public:
  // No errors.
  SharedErrors() = default;
  explicit SharedErrors(SharedErrorsInput input);

  // Deviations [m] that independent errors of one standard deviation cause at the targets: one row
  // a target, one column an error. Targets that no scan informs about have rows of zeros.
  Eigen::MatrixXd CalibrationDeviations(std::span<const uint32_t> targets) const;
  Eigen::MatrixXd RegistrationDeviations(std::span<const uint32_t> targets) const;

  // Standard uncertainties [m] at a target; false: no scan informs about it.
  struct AtTarget {
    double calibration_m = 0, registration_m = 0;
  };
  bool Evaluate(uint32_t target, AtTarget* result) const;

  const std::vector<FrameRegistration>& frames() const { return frames_; }
  // The number of the frame of a scan of the input.
  size_t frame_of(size_t scan) const { return input_.scans[scan].frame; }

 private:
  using Row6 = Eigen::Matrix<double, 1, 6>;
  // Part that a scan has in a target's estimate.
  struct Share {
    uint32_t scan = 0, index = 0;
    double weight = 0;
  };

  std::span<const Share> SharesOf(uint32_t target) const;
  Row6 PoseRow(uint32_t target) const;
  Eigen::RowVectorXd CalibrationRowOf(uint32_t target) const;
  Eigen::RowVectorXd RegistrationRowOf(uint32_t target) const;
  // Effects of the errors of the calibration on the scan's own estimate.
  Eigen::RowVectorXd PlaceRow(const Share& share) const;
  std::vector<double> NeighbourCounts() const;
  void Register();

  SharedErrorsInput input_;
  size_t place_count_ = 0, frame_count_ = 0;
  std::vector<size_t> begin_;  // of each target's shares; one more at the end
  std::vector<Share> shares_;
  Eigen::Vector3d centre_m_ = Eigen::Vector3d::Zero();
  double radius_m_ = 1;  // rotations are in units of 1 / radius: displacements at that distance
  Eigen::MatrixXd place_root_, lens_root_;
  Eigen::MatrixXd response_;   // (6 frames) x calibration columns
  Eigen::MatrixXd pose_root_;  // (6 frames) x registration columns
  std::vector<FrameRegistration> frames_;
};

}  // namespace sightline
