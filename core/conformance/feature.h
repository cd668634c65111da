// SPDX-License-Identifier: Apache-2.0
// Toleranced features of a part: their measurands, and the standard uncertainty of these for a plan
// of scans (JCGM 100, GUM; JCGM 101, Monte Carlo; measurands after ISO 1101 and ISO 14405-1).
//
// A feature is a set of targets. Its surface deviates from the CAD model by h_i along the outward
// normal of target i, and the inference estimates h_i with the error
//   e_i = a_i + sum over scans s of w_is J_is (c_s + c_0),
// a_i ~ N(0, noise_i^2 + sampling_i^2) independent between targets farther apart than twice the
// neighbourhood of the inference, whose estimates share no points; J_is the derivatives of the
// normal deviation that scan s measures at target i with respect to the calibration variables, w_is
// the scan's weight in the estimate (which sum to little less than one), c_s the calibration errors
// of the scan alone and c_0 those that all scans share, such as intrinsic ones of the same camera.
// Hence the covariance of all targets is D + F F' with a diagonal D and few columns in F.
//
// Measurands are linear in h where a plane or cylinder is fitted, and the GUM's linear propagation
// is exact for normally distributed e (a cylinder's fit is linearised about the nominal one: an
// axis d out of place adds d^2 / 2R, 0.06 um for 50 um on a radius of 20 mm). Form is the range of
// what the fit leaves, see PredictUncertainty. The datum is taken as exact: an uncertain datum is
// to be added by the caller.
//
// The predictions hold as far as the inference's prior does
// (bench/uncertainty/virtual_measurement.cpp). Its mean is the model: a feature that as a whole is
// farther out of place than the prior's standard deviation is pulled back to the model, the more so
// the larger the calibration errors, and then is not covered by u. A prior much wider than the
// calibration errors avoids that at the cost of a larger u.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/association/association.h"
#include "core/surface_inference/surface_inference.h"
#include "core/triangulation/calibration_derivatives.h"

namespace sightline {

struct FeatureTarget {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // outward, unit
  // Noise and sampling are used; calibration comes from the scans below, because errors common to
  // targets have to be added with their signs.
  SurfaceUncertainty uncertainty{};
  bool measured = true;  // by any scan
  bool known = true;     // well enough to be evaluated, if it is measured
  bool used() const { return measured && known; }
  int face = 0;  // 0 or 1: which of two planes (FeatureGeometry::kTwoPlanes)
};

// One scan as seen from the targets of the feature, row i of both for target i.
struct ScanSensitivity {
  Eigen::Matrix<double, Eigen::Dynamic, kCalibrationVariables> derivatives;
  Eigen::VectorXd weights;           // 0 where the scan measures nothing
  CalibrationCovariance covariance;  // of this scan's own errors
};

enum class FeatureGeometry {
  kFreeform,   // nothing is fitted; deviation only
  kLine,       // offset and slope along `axis`; for lines on a surface
  kPlane,      // offset and two tilts
  kCylinder,   // radius, two displacements and two tilts of the axis
  kTwoPlanes,  // two planes with parallel normals, of either side; offset and two tilts each
};

enum class Measurand {
  kDeviation,    // of every target by itself: profile of a line or surface
  kForm,         // straightness, flatness, roundness and cylindricity: range of what the fit leaves
  kPosition,     // displacement of the fitted line or plane at any target, or of the axis of the
                 // fitted cylinder at either end in any direction
  kOrientation,  // fall of the fitted line, plane or axis over the feature, worst direction
  kSize,         // diameter of the fitted cylinder; distance of two planes at their common centre
};

struct Feature {
  FeatureGeometry geometry = FeatureGeometry::kFreeform;
  std::vector<FeatureTarget> targets;
  std::vector<ScanSensitivity> scans;
  // Covariance of the errors that all scans share.
  CalibrationCovariance common_covariance = CalibrationCovariance::Zero();
  // Further errors common to the targets. Element (i, k) is the deviation [m] of target i that the
  // k-th of several independent errors causes if it is as large as its standard deviation. Without
  // columns there are none. The first count among `calibration_m` (core/shared_errors), the second,
  // such as those of the pose of a registered part, among `registration_m`.
  Eigen::MatrixXd common_deviations_m;
  Eigen::MatrixXd registration_deviations_m;
  // For targets closer than twice the neighbourhood: the independent part gets the correlation
  // exp(-d^2 / 2 L^2) at distance d; 0: none. With l the length scale of the inference, L = 2 l
  // where calibration errors count: they cannot be told from the surface's mean over the
  // neighbourhood, which neighbours share (virtual measurement with targets 2 l and 4 l apart:
  // spread of fitted parameters 0.96 to 1.05 u, but 2.2 u for tilt without the correlation).
  // Without calibration errors L = 0 gives 0.9 to 1 u.
  double correlation_length_m = 0;
  // A point on the axis of a cylinder; direction of the axis, or of a line (unit).
  Eigen::Vector3d axis_point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
};

// Numbers of targets, and of targets times scans, that a feature may have.
inline constexpr size_t kMostFeatureTargets = 100'000;
inline constexpr size_t kMostFeatureSensitivities = 1'000'000;
// For form, and with a correlation length: matrices of targets times targets are needed.
inline constexpr size_t kMostDenseTargets = 2'000;

// InvalidArgument that names the field and target where numbers are missing, not finite or outside
// their range; normals must be within 0.3 rad of what the geometry says.
absl::Status CheckFeature(const Feature& feature);

// Least-squares fit to the deviations of the used targets, with equal weights as for associated
// features of ISO 1101: parameters = estimator * deviations.
struct FeatureFit {
  std::vector<int> used;        // indices of the targets that are measured and known well enough
  std::vector<int> toleranced;  // indices of the targets that the tolerance binds, used or not
  // toleranced x parameters: deviations that a parameter of 1 m causes. Without rows: none.
  Eigen::MatrixXd design;
  Eigen::MatrixXd estimator;  // parameters x used
  // For every toleranced target, the surface whose range of residuals it belongs to; empty: one.
  std::vector<int> surface_of;
  // Rows c of measurands c . parameters [m]; of more than one the worst counts. By measurand,
  // empty for kDeviation and kForm.
  Eigen::MatrixXd functionals;
  // Form only. kChebyshev: the parameters are those of the minimum zone, and `estimator` serves the
  // uncertainty alone.
  Association association = Association::kGauss;
  // Form only: the zone lies about the model to either side alike, as that of a profile does. Twice
  // the largest |residual| counts in place of the range.
  bool about_model = false;
};

// FailedPrecondition: the measured targets do not determine the fit, or the geometry does not have
// this measurand.
absl::StatusOr<FeatureFit> FitFeature(const Feature& feature, Measurand measurand);

// Residuals of the fit [m]: the rest of `deviations_m` (one for each used target), at the
// toleranced targets that are used, in the order of FeatureFit::toleranced.
Eigen::VectorXd FitResiduals(const FeatureFit& fit, const Eigen::VectorXd& deviations_m);

// Range [m] of the residuals of `deviations_m` (one for each used target), by the association of
// the fit; the largest one if there are several surfaces.
double FormDeviation(const FeatureFit& fit, const Eigen::VectorXd& deviations_m);

// Uncertainty of the measurand [m]; total^2 = noise^2 + sampling^2 + calibration^2 +
// registration^2.
struct MeasurandUncertainty {
  SurfaceUncertainty u{};  // at the worst target, functional or pair of targets
  int worst = 0;           // its index: target, or row of the functionals
  double bias_m = 0;       // of form: mean of what is measured on a perfect feature
  // Filled for kDeviation: u of every toleranced target's residual; infinite if it is not used.
  Eigen::VectorXd target_u_m;
  std::vector<SurfaceUncertainty> target_parts;  // the same with its parts
};

// Standard uncertainty of the measurand of a checked feature.
//
// Form. The range r = max - min of the residuals has no derivative on a perfect feature, and linear
// propagation fails there: errors add a bias to the range (about 4 standard deviations of a
// residual for 25 targets), and its spread is below u. On a feature whose form exceeds the errors,
// one pair of targets makes the range, and it is as uncertain as the difference of two residuals.
// Both are computed: bias and spread on the perfect feature by Monte Carlo on the joint covariance
// (2000 draws, `seed`; JCGM 101), and the linear u of the worst pair; u is the larger, a bound
// rather than the standard deviation. The bias falls from its value here as the true form grows:
// towards zero where single targets make the form, and below zero where the prior smooths the
// extremes. A subtraction of it is right for perfect features only. Form between the targets is not
// seen by any of this.
//
// A minimum zone has the same bound u. Its width Z(h) is convex in the deviations h, and its
// gradient is a convex combination of residuals at one side less one at the other side. That
// difference is no more uncertain than the worst pair of least-squares residuals. Convexity also
// bounds the measured width from below: Z(h + e) >= Z(h) + gradient . e, so that errors hide form
// with no more than this u.
absl::StatusOr<MeasurandUncertainty> PredictUncertainty(const Feature& feature, Measurand measurand,
                                                        uint64_t seed = 1);
// The same, with a given fit of this feature.
absl::StatusOr<MeasurandUncertainty> PredictUncertainty(const Feature& feature,
                                                        const FeatureFit& fit, Measurand measurand,
                                                        uint64_t seed = 1);

// Reproducible draws (JCGM 101) of the joint errors of the estimates of a checked feature, with the
// covariance that PredictUncertainty uses.
class ErrorDraws {
 public:
  // Errors of the deviations of the used targets, or of the parameters of the fit [m].
  static absl::StatusOr<ErrorDraws> OfDeviations(const Feature& feature, const FeatureFit& fit);
  static absl::StatusOr<ErrorDraws> OfParameters(const Feature& feature, const FeatureFit& fit);

  // The same seed and number give the same errors.
  Eigen::VectorXd Draw(uint64_t seed, uint64_t number) const;
  // Number of multiplications of one draw, for limits on work.
  int64_t Cost() const;

 private:
  Eigen::VectorXd independent_m_;  // standard deviations
  Eigen::MatrixXd root_;           // of the correlation of these; empty: the identity
  Eigen::MatrixXd common_m_;       // columns: effects of common errors of one standard deviation
};

}  // namespace sightline
