// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/hand_eye.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/block_adjustment/block_adjustment.h"
#include "core/scanner_calibration/target_camera.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

using Motions = std::vector<Eigen::Isometry3d>;

Eigen::VectorXd SixOf(const Eigen::Isometry3d& motion) {
  Eigen::VectorXd six(6);
  six << RotationVector(motion.linear()), motion.translation();
  return six;
}

// Closed form: A X = X B over all pairs of frames.
absl::StatusOr<Eigen::Isometry3d> StartHandEye(const Motions& flange, const Motions& target) {
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Zero();
  std::vector<std::pair<Eigen::Isometry3d, Eigen::Isometry3d>> pairs;
  for (size_t i = 0; i < flange.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      pairs.emplace_back(flange[j].inverse() * flange[i], target[j] * target[i].inverse());
      correlation += RotationVector(pairs.back().first.linear()) *
                     RotationVector(pairs.back().second.linear()).transpose();
    }
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(correlation,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[1] > 1e-6 * static_cast<double>(pairs.size()))) {
    return absl::InvalidArgumentError(
        "the flange turns about less than two axes between the frames, which leaves the camera's "
        "place on it open");
  }
  const Eigen::Matrix3d turns = svd.matrixU() * svd.matrixV().transpose();
  Eigen::Vector3d signs(1, 1, turns.determinant() < 0 ? -1 : 1);
  Eigen::Isometry3d start = Eigen::Isometry3d::Identity();
  start.linear() = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  Eigen::MatrixXd rows(3 * static_cast<Eigen::Index>(pairs.size()), 3);
  Eigen::VectorXd wanted(rows.rows());
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto at = 3 * static_cast<Eigen::Index>(i);
    rows.middleRows<3>(at) = pairs[i].first.linear() - Eigen::Matrix3d::Identity();
    wanted.segment<3>(at) =
        start.linear() * pairs[i].second.translation() - pairs[i].first.translation();
  }
  start.translation() = rows.jacobiSvd(Eigen::ComputeThinU | Eigen::ComputeThinV).solve(wanted);
  return start;
}

// Parameters of the adjustment: camera in flange, target in base (both MotionOf), and the factor
// of the target's positions in the camera.
constexpr int kTargetInBase = 6, kScale = 12, kHandEyeParameters = 13;

// Residuals of one frame: turn [rad] and position [m] of the target in the base.
Eigen::VectorXd Closure(const Eigen::Isometry3d& flange, const Eigen::Isometry3d& target,
                        const Eigen::VectorXd& parameters) {
  Eigen::Isometry3d scaled = target;
  scaled.translation() *= parameters[kScale];
  const Eigen::Isometry3d seen = flange * MotionOf(parameters.head<6>()) * scaled;
  const Eigen::Isometry3d there = MotionOf(parameters.segment<6>(kTargetInBase));
  Eigen::VectorXd r(6);
  r << RotationVector(there.linear().transpose() * seen.linear()),
      seen.translation() - there.translation();
  return r;
}

double ClosureOf(const Motions& flange, const Motions& target) {
  const auto found = FindHandEye(flange, target);
  return found.ok() ? found->closure_m : std::numeric_limits<double>::infinity();
}

// The target as a mirrored image shows it: x of the camera has the other sign, and so has x of the
// target.
Motions Mirrored(Motions target) {
  const Eigen::Vector3d flip(-1, 1, 1);
  for (Eigen::Isometry3d& motion : target) {
    motion.linear() = flip.asDiagonal() * motion.linear() * flip.asDiagonal();
    motion.translation() = flip.asDiagonal() * motion.translation();
  }
  return target;
}

struct AdjustedHandEye {
  HandEye hand_eye;
  RobotScale scale;
};

// `scale_sd`: prior standard deviation of the scale about 1; 0 holds it.
absl::StatusOr<AdjustedHandEye> Adjust(const Motions& flange, const Motions& target,
                                       double scale_sd) {
  if (flange.size() != target.size() || flange.size() < 3) {
    return absl::InvalidArgumentError("at least three frames with poses are needed");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto start, StartHandEye(flange, target));
  BlockProblem problem;
  problem.shared.resize(kHandEyeParameters);
  problem.shared << SixOf(start), SixOf(flange[0] * start * target[0]), 1;
  problem.shared_step = Eigen::VectorXd::Constant(kHandEyeParameters, 1e-6);
  problem.prior_standard_deviation =
      Eigen::VectorXd::Constant(kHandEyeParameters, std::numeric_limits<double>::infinity());
  problem.prior_standard_deviation[kScale] = scale_sd;
  problem.own.assign(flange.size(), Eigen::VectorXd(0));
  double turn_sd = 1e-3, position_sd = 1e-3;
  AdjustedHandEye adjusted;
  for (int pass = 0; pass < 3; ++pass) {
    problem.residuals = [&](int k, const Eigen::VectorXd& parameters,
                            const Eigen::VectorXd&) -> Eigen::VectorXd {
      Eigen::VectorXd r =
          Closure(flange[static_cast<size_t>(k)], target[static_cast<size_t>(k)], parameters);
      r.head<3>() /= turn_sd;
      r.tail<3>() /= position_sd;
      return r;
    };
    SIGHTLINE_ASSIGN_OR_RETURN(const auto solution, AdjustBlocks(problem));
    // A prior is about its start: the scale starts at 1 again.
    problem.shared = solution.shared;
    problem.shared[kScale] = 1;
    HandEye result;
    result.camera_in_flange = solution.shared.head<6>();
    result.covariance = solution.shared_covariance.topLeftCorner<6, 6>();
    for (size_t k = 0; k < flange.size(); ++k) {
      const Eigen::VectorXd r = Closure(flange[k], target[k], solution.shared);
      result.turn_rad.push_back(r.head<3>().norm());
      result.position_m.push_back(r.tail<3>().norm());
      result.closure_rad += r.head<3>().squaredNorm() / static_cast<double>(flange.size());
      result.closure_m += r.tail<3>().squaredNorm() / static_cast<double>(flange.size());
    }
    result.closure_rad = std::sqrt(result.closure_rad);
    result.closure_m = std::sqrt(result.closure_m);
    const double freedom = 3 - 6.0 / static_cast<double>(flange.size());
    turn_sd = std::max(1e-9, result.closure_rad / std::sqrt(freedom));
    position_sd = std::max(1e-9, result.closure_m / std::sqrt(freedom));
    adjusted.hand_eye = std::move(result);
    adjusted.scale = {.value = solution.shared[kScale],
                      .standard_error = std::sqrt(solution.shared_covariance(kScale, kScale))};
  }
  return adjusted;
}

}  // namespace

absl::StatusOr<HandEye> FindHandEye(const Motions& flange, const Motions& target) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto adjusted, Adjust(flange, target, 0));
  return std::move(adjusted.hand_eye);
}

absl::StatusOr<RobotScale> ScaleByRobot(const Motions& flange, const Motions& target) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto adjusted,
                             Adjust(flange, target, std::numeric_limits<double>::infinity()));
  return adjusted.scale;
}

std::string WhyPosesDoNotFit(const Motions& flange, const Motions& target,
                             const std::vector<std::string>& names, double closure_m) {
  const double enough = closure_m / 3;
  Motions other = flange;
  std::rotate(other.begin(), other.begin() + 1, other.end());
  if (ClosureOf(other, target) < enough) return "each pose fits the frame before its own";
  other = flange;
  std::rotate(other.rbegin(), other.rbegin() + 1, other.rend());
  if (ClosureOf(other, target) < enough) return "each pose fits the frame after its own";
  other = flange;
  std::reverse(other.begin(), other.end());
  if (ClosureOf(other, target) < enough) return "the poses fit the frames in reverse order";
  other = flange;
  for (Eigen::Isometry3d& motion : other) motion = motion.inverse();
  if (ClosureOf(other, target) < enough) {
    return "the inverse poses fit: they are poses of the base in the flange";
  }
  if (ClosureOf(flange, Mirrored(target)) < enough) return "the images are mirrored";
  for (size_t i = 0; i < flange.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      other = flange;
      std::swap(other[i], other[j]);
      if (ClosureOf(other, target) < enough) {
        return absl::StrCat("the poses of ", names[j], " and ", names[i], " are exchanged");
      }
    }
  }
  // A scale that is far too small also leaves less than one that is far too large: the best counts.
  double best = enough, best_scale = 0;
  for (const double scale : {1e-3, 0.01, 0.0254, 0.1, 0.5, 2.0, 10.0, 39.37, 100.0, 1000.0}) {
    other = target;
    for (Eigen::Isometry3d& motion : other) motion.translation() *= scale;
    const double closure = ClosureOf(flange, other);
    if (closure >= best) continue;
    best = closure;
    best_scale = scale;
  }
  if (best_scale > 0) {
    return absl::StrCat("they fit if checkerboard.square_m is ", best_scale,
                        " times what is stated");
  }
  return "";
}

}  // namespace sightline
