// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/rig_adjustment.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/block_adjustment/block_adjustment.h"
#include "core/block_adjustment/covariance_between_blocks.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr double kStartCornerSd_px = 0.3;

double SurfaceHeight(const Eigen::VectorXd& shared, double x, double y) {
  return shared[kBendXx] * x * x + shared[kBendXy] * x * y + shared[kBendYy] * y * y;
}

Eigen::VectorXd CornerResiduals(const TargetBoard& board, const CalibrationFrame& frame,
                                const Eigen::VectorXd& shared, const Eigen::VectorXd& pose) {
  const TargetCamera camera = CameraOf(shared);
  const Eigen::Isometry3d motion = MotionOf(pose);
  Eigen::VectorXd residuals(2 * board.corner_count());
  for (int i = 0; i < board.corner_count(); ++i) {
    const Eigen::Vector2d at = board.Corner(i);
    const Eigen::Vector3d point =
        motion * Eigen::Vector3d(at.x(), at.y(), SurfaceHeight(shared, at.x(), at.y()));
    residuals.segment<2>(2 * i) = camera.Project(point) - frame.corners_px[static_cast<size_t>(i)];
  }
  return residuals;
}

// Height of the surface under the line.
double LineHeight(TargetShape shape, const Eigen::VectorXd& shared, double x, double y) {
  return shape == TargetShape::kBent ? SurfaceHeight(shared, x, y) : 0;
}

// Meets the ray with the surface under the line: a plane at the height of the last point, a few
// times.
Eigen::Vector3d PointOnTarget(TargetShape shape, const Eigen::VectorXd& shared,
                              const Eigen::Isometry3d& motion, const Eigen::Vector3d& ray) {
  const Eigen::Vector3d normal = motion.linear().col(2);
  double height = 0;
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4; ++i) {
    point = ray * (normal.dot(motion.translation()) + height) / normal.dot(ray);
    const Eigen::Vector3d on_target = motion.inverse() * point;
    height = LineHeight(shape, shared, on_target.x(), on_target.y());
  }
  return point;
}

// Distances of line samples on the target from the laser plane [m], and those that a shift of 1 px
// across the line makes.
void LineDistances(TargetShape shape, const CalibrationFrame& frame, const Eigen::VectorXd& shared,
                   const Eigen::VectorXd& pose, Eigen::VectorXd* distance_m,
                   Eigen::VectorXd* per_px) {
  const TargetCamera camera = CameraOf(shared);
  const Eigen::Isometry3d motion = MotionOf(pose);
  const Eigen::Vector3d plane = shared.segment<3>(kPlaneX);
  const auto count = static_cast<Eigen::Index>(frame.line.samples.size());
  distance_m->resize(count);
  per_px->resize(count);
  const auto distance = [&](const Eigen::Vector2d& image_px) {
    const Eigen::Vector3d point = PointOnTarget(shape, shared, motion, camera.Ray(image_px));
    return (plane.dot(point) - 1) / plane.norm();
  };
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Vector2d& at = frame.line.samples[static_cast<size_t>(i)].image_px;
    (*distance_m)[i] = distance(at);
    (*per_px)[i] = std::abs(distance(at + frame.line.across) - (*distance_m)[i]);
  }
}

double LineSd(const CalibrationFrame& frame) { return std::max(0.02, frame.line.sample_sd_px); }

// The plane q . x = 1 closest to the lines on the target, for a start.
Eigen::Vector3d StartPlane(const std::vector<CalibrationFrame>& frames,
                           const Eigen::VectorXd& shared) {
  const TargetCamera camera = CameraOf(shared);
  std::vector<Eigen::Vector3d> points;
  for (const CalibrationFrame& frame : frames) {
    const Eigen::Isometry3d motion = MotionOf(frame.pose);
    for (const LineSample& sample : frame.line.samples) {
      points.push_back(
          PointOnTarget(TargetShape::kFlat, shared, motion, camera.Ray(sample.image_px)));
    }
  }
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const auto& p : points) spread += (p - mean) * (p - mean).transpose();
  const Eigen::Vector3d normal =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(0);
  return normal / normal.dot(mean);
}

// Factor by which chi^2 of one kind of residual exceeds its degrees of freedom.
struct Scales {
  double corners = kStartCornerSd_px;
  double line = 1;
};

BlockProblem MakeProblem(const TargetBoard& board, const std::vector<CalibrationFrame>& frames,
                         const CameraPrior& prior, TargetShape shape, const Scales& scales) {
  BlockProblem problem;
  problem.shared = Eigen::VectorXd::Zero(kSharedParameters);
  problem.shared.head<4>() << prior.camera.fx, prior.camera.fy, prior.camera.cx, prior.camera.cy;
  problem.shared_step = Eigen::VectorXd::Constant(kSharedParameters, 1e-4);
  problem.shared_step.head<4>().setConstant(0.05);
  problem.prior_standard_deviation =
      Eigen::VectorXd::Constant(kSharedParameters, std::numeric_limits<double>::infinity());
  for (int i = 0; i < 9; ++i) {
    if (i >= 4) problem.shared[i] = prior.camera.distortion[static_cast<size_t>(i - 4)];
    problem.prior_standard_deviation[i] = prior.standard_deviation[static_cast<size_t>(i)];
  }
  if (shape == TargetShape::kFlat) problem.prior_standard_deviation.segment<3>(kBendXx).setZero();
  problem.shared_step.segment<3>(kBendXx).setConstant(1e-3);
  problem.shared.segment<3>(kPlaneX) = StartPlane(frames, problem.shared);
  for (const CalibrationFrame& frame : frames) problem.own.push_back(frame.pose);
  problem.residuals = [&board, &frames, shape, scales](
                          int k, const Eigen::VectorXd& shared,
                          const Eigen::VectorXd& pose) -> Eigen::VectorXd {
    const CalibrationFrame& frame = frames[static_cast<size_t>(k)];
    const Eigen::VectorXd corners = CornerResiduals(board, frame, shared, pose) / scales.corners;
    Eigen::VectorXd distance, per_px;
    LineDistances(shape, frame, shared, pose, &distance, &per_px);
    Eigen::VectorXd all(corners.size() + distance.size());
    all << corners, distance.cwiseQuotient(per_px * (LineSd(frame) * scales.line));
    return all;
  };
  return problem;
}

// Root of chi^2 per observation of corners and of line samples at a solution, as scales.
Scales ScalesAt(const TargetBoard& board, const std::vector<CalibrationFrame>& frames,
                TargetShape shape, const BlockSolution& solution) {
  double corners = 0, line = 0, corner_count = 0, line_count = 0;
  for (size_t k = 0; k < frames.size(); ++k) {
    const Eigen::VectorXd r = CornerResiduals(board, frames[k], solution.shared, solution.own[k]);
    corners += r.squaredNorm();
    corner_count += static_cast<double>(r.size());
    Eigen::VectorXd distance, per_px;
    LineDistances(shape, frames[k], solution.shared, solution.own[k], &distance, &per_px);
    line += distance.cwiseQuotient(per_px * LineSd(frames[k])).squaredNorm();
    line_count += static_cast<double>(distance.size());
  }
  const double freedom = std::max(
      0.1, 1 - static_cast<double>(solution.parameter_count) / (corner_count + line_count));
  return {std::sqrt(corners / (corner_count * freedom)),
          std::max(1.0, std::sqrt(line / (line_count * freedom)))};
}

}  // namespace

absl::StatusOr<AdjustedRig> AdjustRig(const TargetBoard& board,
                                      const std::vector<CalibrationFrame>& frames,
                                      const CameraPrior& prior, TargetShape shape) {
  if (frames.size() < 3) {
    return absl::InvalidArgumentError("at least three frames determine a laser plane");
  }
  Scales scales;
  absl::StatusOr<BlockSolution> solution;
  for (int pass = 0; pass < 3; ++pass) {
    BlockProblem problem = MakeProblem(board, frames, prior, shape, scales);
    if (pass > 0) problem.own = solution->own;
    solution = AdjustBlocks(problem);
    if (!solution.ok()) return solution.status();
    if (pass < 2) scales = ScalesAt(board, frames, shape, *solution);
  }
  return AdjustedRig{.shared = solution->shared,
                     .covariance = CovarianceBetweenBlocks(*solution),
                     .poses = solution->own,
                     .corner_sd_px = scales.corners,
                     .line_scale = scales.line};
}

absl::StatusOr<TargetPose> PoseOfTarget(const TargetBoard& board, const CalibrationFrame& frame,
                                        const Eigen::VectorXd& shared, double corner_sd_px) {
  BlockProblem problem;
  problem.shared = frame.pose;
  problem.own.emplace_back(0);
  problem.shared_step = Eigen::VectorXd::Constant(6, 1e-6);
  problem.prior_standard_deviation =
      Eigen::VectorXd::Constant(6, std::numeric_limits<double>::infinity());
  problem.residuals = [&](int, const Eigen::VectorXd& pose,
                          const Eigen::VectorXd&) -> Eigen::VectorXd {
    return CornerResiduals(board, frame, shared, pose) / corner_sd_px;
  };
  SIGHTLINE_ASSIGN_OR_RETURN(const auto solution, AdjustBlocks(problem));
  return TargetPose{
      .pose = solution.shared,
      .covariance = solution.shared_covariance,
      .rms_px = corner_sd_px * std::sqrt(solution.sum_of_squares / board.corner_count())};
}

Eigen::Vector3d PointOnPlane(const Eigen::VectorXd& shared, const Eigen::Vector2d& image_px) {
  const Eigen::Vector3d ray = CameraOf(shared).Ray(image_px);
  return ray / shared.segment<3>(kPlaneX).dot(ray);
}

double HeightOverTarget(TargetShape shape, const Eigen::VectorXd& shared,
                        const Eigen::VectorXd& pose, const Eigen::Vector3d& point_m) {
  const Eigen::Vector3d p = MotionOf(pose).inverse() * point_m;
  return p.z() - LineHeight(shape, shared, p.x(), p.y());
}

}  // namespace sightline
