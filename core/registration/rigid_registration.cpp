// SPDX-License-Identifier: Apache-2.0
#include "core/registration/rigid_registration.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "absl/strings/str_cat.h"
#include "core/statistics/order_statistics.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr double kTukey = 4.685;  // 95 % efficiency for Gaussian residuals
constexpr double kMadToSigma = 1.4826;
// For exact points only rounding errors are left.
constexpr double kSmallestResidual = 1e-8;
constexpr size_t kCoarsePoints = 3000;
constexpr size_t kFewestPoints = 6;
constexpr double kNotFixed = 0.5;
constexpr size_t kFewestSure = 20;  // a part of one in so many points
constexpr double kLeastNoiseShare = 0.01;
// The reach of the biweight shrinks by this factor a step, from all points down to the scale of the
// residuals (graduated non-convexity: Yang et al., IEEE Robotics and Automation Letters 5(2),
// 2020).
constexpr double kNarrowing = 0.7;

Eigen::Matrix3d RotationOf(const Eigen::Vector3d& theta) {
  const double angle = theta.norm();
  if (angle == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle, theta / angle).toRotationMatrix();
}

// A point against the model: residual and its derivative with respect to a further small motion
// (omega, dt) that follows the present one.
struct Residual {
  double value = 0;
  PoseVector derivative;
  Eigen::Vector3d place_m;  // in the model
};

class Estimator {
 public:
  Estimator(const SurfaceIndex& model, std::span<const Eigen::Vector3d> points,
            std::span<const Eigen::Vector3d> normals, const RegistrationOptions& options)
      : model_(model), points_(points), normals_(normals), options_(options) {
    const PoseVector deviations = options.prior.StandardDeviations();
    prior_precision_ = deviations.array().square().inverse().matrix();
    result_.pose.centre_m = model.mesh().BoundingBox().center();
    size_m_ = 0.5 * model.mesh().BoundingBox().sizes().norm();
  }

  absl::Status Iterate(size_t most_points, bool choose_faces) {
    const size_t stride = (points_.size() + most_points - 1) / most_points;
    if (choose_faces) ChooseSurePoints(stride);
    result_.converged = false;
    // Only the first pass starts far off.
    double widened = choose_faces ? 0 : std::numeric_limits<double>::infinity();
    for (int i = 0; i < options_.max_iterations && !result_.converged; ++i) {
      Measure(stride);
      if (std::isinf(widened)) widened = LargestResidual() / kTukey;
      const bool is_narrow = widened <= scale_;
      scale_ = std::max(scale_, widened);
      widened *= kNarrowing;
      if (residuals_.size() < kFewestPoints) {
        return absl::FailedPreconditionError(
            absl::StrCat("only ", residuals_.size(), " of ", points_.size() / stride,
                         " points lie within ", 1e3 * options_.reach_m, " mm of the model"));
      }
      PoseCovariance hessian = prior_precision_.asDiagonal();
      PoseVector gradient = prior_precision_.cwiseProduct(result_.pose.parameters);
      const double inverse_square = 1 / (scale_ * scale_);
      for (const Residual& r : residuals_) {
        const double weight = Weight(r.value) * inverse_square;
        hessian += weight * r.derivative * r.derivative.transpose();
        gradient += weight * r.value * r.derivative;
      }
      const PoseVector step = -hessian.ldlt().solve(gradient);
      Move(step);
      ++result_.iterations;
      const double moved_m = step.head<3>().norm() * size_m_ + step.tail<3>().norm();
      result_.converged = is_narrow && moved_m <= std::max(1e-3 * raw_scale_m_, 1e-9);
    }
    return absl::OkStatus();
  }

  Registration Finish() {
    Measure((points_.size() + options_.most_points - 1) / options_.most_points);
    result_.residual_standard_deviation_m = raw_scale_m_;
    result_.points = static_cast<int64_t>(residuals_.size());
    AddCovariance();
    return std::move(result_);
  }

 private:
  // A measured point in the model's frame at the present pose, and the nearest surface point.
  struct Match {
    Eigen::Vector3d arm_m, place_m;
    SurfacePoint on;
  };
  std::optional<Match> MatchOf(size_t i, const Eigen::Matrix3d& rotation) const {
    Match match;
    match.arm_m = points_[i] - (result_.pose.centre_m + result_.pose.parameters.tail<3>());
    match.place_m = rotation.transpose() * match.arm_m + result_.pose.centre_m;
    const Eigen::Vector3d facing = normals_.empty() ? Eigen::Vector3d::Zero().eval()
                                                    : (rotation.transpose() * normals_[i]).eval();
    const auto on = model_.Nearest(match.place_m, facing, options_.reach_m);
    if (!on) return std::nullopt;
    match.on = *on;
    return match;
  }

  // Leaves out points that noise may have brought from another face, unless few others are left: of
  // a part with no face larger than the noise all points are as good.
  void ChooseSurePoints(size_t stride) {
    sure_.clear();
    if (!options_.noise_m2) return;
    const Eigen::Matrix3d rotation = result_.pose.Rotation();
    std::vector<uint8_t> sure(points_.size(), 0);
    size_t matched = 0, chosen = 0;
    for (size_t i = 0; i < points_.size(); i += stride) {
      const auto match = MatchOf(i, rotation);
      if (!match) continue;
      ++matched;
      const double spread_m = std::sqrt(options_.noise_m2(i).trace());
      sure[i] = model_.OnOneFace(match->on, kSureDeviations * spread_m);
      chosen += sure[i];
    }
    if (chosen >= kFewestPoints && chosen * kFewestSure >= matched) sure_ = std::move(sure);
  }

  // Standard deviation of a point's noise along the surface there; 1 if noise is not known.
  double NoiseAlong(size_t i, const Eigen::Vector3d& normal) const {
    if (!options_.noise_m2) return 1;
    const Eigen::Matrix3d noise = options_.noise_m2(i);
    // If noise moves a point only along the surface, the deviation of the surface itself counts.
    return std::sqrt(std::max(normal.dot(noise * normal), kLeastNoiseShare * noise.trace()));
  }

  // Residuals of every stride-th point at the present pose, in units of their noise, and their
  // scale.
  void Measure(size_t stride) {
    residuals_.clear();
    std::vector<double> raw_m;
    const Eigen::Matrix3d rotation = result_.pose.Rotation();
    for (size_t i = 0; i < points_.size(); i += stride) {
      if (!sure_.empty() && sure_[i] == 0) continue;
      const auto match = MatchOf(i, rotation);
      if (!match) continue;
      const Eigen::Vector3d normal = rotation * match->on.normal;
      const double noise_m = NoiseAlong(i, normal);
      if (!(noise_m > 0) || !std::isfinite(noise_m)) continue;
      Residual residual;
      const double deviation_m = match->on.Deviation(match->place_m);
      residual.value = deviation_m / noise_m;
      residual.derivative << -match->arm_m.cross(normal), -normal;
      residual.derivative /= noise_m;
      residual.place_m = match->place_m;
      residuals_.push_back(residual);
      raw_m.push_back(std::abs(deviation_m));
    }
    if (residuals_.empty()) return;
    std::vector<double> sizes;
    sizes.reserve(residuals_.size());
    for (const Residual& r : residuals_) sizes.push_back(std::abs(r.value));
    scale_ = std::max(kSmallestResidual, kMadToSigma * UpperMedian(std::move(sizes)));
    raw_scale_m_ = kMadToSigma * UpperMedian(std::move(raw_m));
  }

  double LargestResidual() const {
    double largest = 0;
    for (const Residual& r : residuals_) largest = std::max(largest, std::abs(r.value));
    return largest;
  }

  double Weight(double value) const {
    const double u = value / (kTukey * scale_);
    const double rest = 1 - u * u;
    return rest > 0 ? rest * rest : 0;
  }

  void Move(const PoseVector& step) {
    const Eigen::AngleAxisd turned(RotationOf(step.head<3>()) * result_.pose.Rotation());
    result_.pose.parameters.head<3>() = turned.angle() * turned.axis();
    result_.pose.parameters.tail<3>() += step.tail<3>();
  }

  void AddCovariance() {
    // With u = r / (k s): psi(r) = r (1 - u^2)^2, psi'(r) = (1 - u^2)(1 - 5 u^2).
    PoseCovariance hessian = PoseCovariance::Zero(), single = PoseCovariance::Zero();
    std::map<std::array<int64_t, 3>, PoseVector> cells;
    const double inverse_square = 1 / (scale_ * scale_);
    for (const Residual& r : residuals_) {
      const double u = r.value / (kTukey * scale_);
      const double rest = 1 - u * u;
      if (rest <= 0) continue;
      hessian += inverse_square * rest * (1 - 5 * u * u) * r.derivative * r.derivative.transpose();
      const PoseVector score = inverse_square * r.value * rest * rest * r.derivative;
      single += score * score.transpose();
      std::array<int64_t, 3> cell;
      for (int axis = 0; axis < 3; ++axis) {
        cell[axis] = std::llround(r.place_m[axis] / options_.correlation_length_m);
      }
      cells.try_emplace(cell, PoseVector::Zero()).first->second += score;
    }
    PoseCovariance clustered = PoseCovariance::Zero();
    for (const auto& [cell, score] : cells) clustered += score * score.transpose();
    if (cells.size() > kFewestPoints) {
      const auto count = static_cast<double>(cells.size());
      clustered *= count / (count - kFewestPoints);
    }
    const PoseVector deviations = options_.prior.StandardDeviations();
    // In units of the prior. A redescending psi can leave a direction with negative curvature where
    // points are few; there the points count for nothing.
    const Eigen::SelfAdjointEigenSolver<PoseCovariance> curvature(
        PoseCovariance(deviations.asDiagonal() * hessian * deviations.asDiagonal()));
    const PoseVector inverse_eigenvalues =
        (curvature.eigenvalues().cwiseMax(0).array() + 1).inverse().matrix();
    const PoseCovariance inverse = deviations.asDiagonal() * curvature.eigenvectors() *
                                   inverse_eigenvalues.asDiagonal() *
                                   curvature.eigenvectors().transpose() * deviations.asDiagonal();
    const PoseCovariance prior = prior_precision_.asDiagonal();
    const PoseCovariance by_points = inverse * (single + prior) * inverse;
    const PoseCovariance by_cells = inverse * (clustered + prior) * inverse;
    const PoseVector relative = deviations.cwiseInverse();
    const auto spread = [&](const PoseCovariance& c) {
      return relative.cwiseProduct(c.diagonal()).dot(relative);
    };
    PoseCovariance covariance = spread(by_cells) > spread(by_points) ? by_cells : by_points;
    covariance = 0.5 * (covariance + covariance.transpose()).eval();

    // Relative to the prior, and never worse known than before.
    const PoseCovariance scaled = relative.asDiagonal() * covariance * relative.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<PoseCovariance> eigen(scaled);
    const PoseVector variances = eigen.eigenvalues().cwiseMax(0).cwiseMin(1);
    covariance = deviations.asDiagonal() * eigen.eigenvectors() * variances.asDiagonal() *
                 eigen.eigenvectors().transpose() * deviations.asDiagonal();
    result_.covariance = 0.5 * (covariance + covariance.transpose());
    for (int k = 5; k >= 0; --k) {
      PoseDirection direction;
      direction.direction = deviations.cwiseProduct(eigen.eigenvectors().col(k));
      direction.standard_deviation_relative = std::sqrt(variances[k]);
      result_.not_fixed += direction.standard_deviation_relative > kNotFixed;
      result_.directions.push_back(direction);
    }
  }

  const SurfaceIndex& model_;
  std::span<const Eigen::Vector3d> points_, normals_;
  const RegistrationOptions& options_;
  PoseVector prior_precision_;
  double size_m_ = 0;  // farthest that a place of the part is from its centre
  double scale_ = 0;   // s
  double raw_scale_m_ = 0;
  std::vector<uint8_t> sure_;  // one per point; empty: all are
  std::vector<Residual> residuals_;
  Registration result_;
};

}  // namespace

PoseVector PosePrior::StandardDeviations() const {
  PoseVector deviations;
  deviations.head<3>().setConstant(rotation_standard_deviation_rad);
  deviations.tail<3>().setConstant(translation_standard_deviation_m);
  return deviations;
}

Eigen::Matrix3d PartPose::Rotation() const { return RotationOf(parameters.head<3>()); }

Eigen::Isometry3d PartPose::Matrix() const {
  Eigen::Isometry3d matrix = Eigen::Isometry3d::Identity();
  matrix.linear() = Rotation();
  matrix.translation() = centre_m + parameters.tail<3>() - Rotation() * centre_m;
  return matrix;
}

absl::StatusOr<Registration> RegisterPoints(const SurfaceIndex& model,
                                            std::span<const Eigen::Vector3d> points_m,
                                            std::span<const Eigen::Vector3d> normals,
                                            const RegistrationOptions& options) {
  if (points_m.size() < kFewestPoints) {
    return absl::InvalidArgumentError(absl::StrCat("registration needs at least ", kFewestPoints,
                                                   " points, there are ", points_m.size()));
  }
  if (!normals.empty() && normals.size() != points_m.size()) {
    return absl::InvalidArgumentError(absl::StrCat("registration: ", points_m.size(),
                                                   " points but ", normals.size(), " normals"));
  }
  Estimator estimator(model, points_m, normals, options);
  for (const bool fine : {false, true}) {
    const size_t most = fine ? options.most_points : std::min(kCoarsePoints, options.most_points);
    SIGHTLINE_RETURN_IF_ERROR(estimator.Iterate(most, fine));
  }
  return estimator.Finish();
}

double PoseVariance(const Registration& registration, const Eigen::Vector3d& place_m,
                    const Eigen::Vector3d& direction) {
  const Eigen::Matrix3d rotation = registration.pose.Rotation();
  const Eigen::Vector3d along = rotation * direction;
  const Eigen::Vector3d arm = rotation * (place_m - registration.pose.centre_m);
  PoseVector derivative;
  derivative << arm.cross(along), along;
  return std::max(0.0, derivative.dot(registration.covariance * derivative));
}

}  // namespace sightline
