// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/left_out_frames.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Distances of all samples for given shared parameters: the pose is found anew from the corners, as
// it depends on the camera.
absl::StatusOr<Eigen::VectorXd> DistancesAt(const TargetBoard& board, TargetShape shape,
                                            const CalibrationFrame& frame,
                                            const Eigen::VectorXd& shared, double corner_sd_px) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto pose, PoseOfTarget(board, frame, shared, corner_sd_px));
  Eigen::VectorXd distances(static_cast<Eigen::Index>(frame.line.samples.size()));
  for (Eigen::Index i = 0; i < distances.size(); ++i) {
    distances[i] =
        HeightOverTarget(shape, shared, pose.pose,
                         PointOnPlane(shared, frame.line.samples[static_cast<size_t>(i)].image_px));
  }
  return distances;
}

}  // namespace

absl::StatusOr<LeftOutFrame> PredictLeftOut(const TargetBoard& board,
                                            const std::vector<CalibrationFrame>& frames,
                                            size_t left_out, const CameraPrior& prior,
                                            TargetShape shape) {
  std::vector<CalibrationFrame> others = frames;
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(left_out));
  const CalibrationFrame& frame = frames[left_out];
  SIGHTLINE_ASSIGN_OR_RETURN(const auto rig, AdjustRig(board, others, prior, shape));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto distances,
                             DistancesAt(board, shape, frame, rig.shared, rig.corner_sd_px));

  // Camera, plane and shape: derivatives by differences of a thousandth of a standard deviation.
  Eigen::MatrixXd by_shared = Eigen::MatrixXd::Zero(distances.size(), kSharedParameters);
  for (int i = 0; i < kSharedParameters; ++i) {
    const double step = 0.1 * std::sqrt(rig.covariance(i, i));
    if (!(step > 0)) continue;
    Eigen::VectorXd moved = rig.shared;
    moved[i] += step;
    SIGHTLINE_ASSIGN_OR_RETURN(const auto there,
                               DistancesAt(board, shape, frame, moved, rig.corner_sd_px));
    by_shared.col(i) = (there - distances) / step;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto pose,
                             PoseOfTarget(board, frame, rig.shared, rig.corner_sd_px));

  LeftOutFrame result;
  const double sample_sd_px = std::max(0.02, frame.line.sample_sd_px) * rig.line_scale;
  for (Eigen::Index i = 0; i < distances.size(); ++i) {
    const LineSample& sample = frame.line.samples[static_cast<size_t>(i)];
    const Eigen::Vector3d point = PointOnPlane(rig.shared, sample.image_px);
    Eigen::VectorXd by_pose(6);
    for (int j = 0; j < 6; ++j) {
      Eigen::VectorXd moved = pose.pose;
      moved[j] += 1e-6;
      by_pose[j] = (HeightOverTarget(shape, rig.shared, moved, point) - distances[i]) / 1e-6;
    }
    const double by_px =
        HeightOverTarget(shape, rig.shared, pose.pose,
                         PointOnPlane(rig.shared, sample.image_px + frame.line.across)) -
        distances[i];
    const double variance = by_shared.row(i) * rig.covariance * by_shared.row(i).transpose() +
                            by_pose.dot(pose.covariance * by_pose) +
                            std::pow(by_px * sample_sd_px, 2);
    result.along_px.push_back(sample.along_px);
    result.distance_m.push_back(distances[i]);
    result.predicted_sd_m.push_back(std::sqrt(variance));
    result.rms_m += std::pow(distances[i], 2);
    result.predicted_rms_m += variance;
  }
  const double count = static_cast<double>(distances.size());
  result.rms_m = std::sqrt(result.rms_m / count);
  result.predicted_rms_m = std::sqrt(result.predicted_rms_m / count);
  return result;
}

ScatterRatio RealOverPredicted(const std::vector<LeftOutFrame>& frames) {
  const auto ratio = [&](auto next) {
    double real = 0, predicted = 0;
    for (size_t i = 0; i < frames.size(); ++i) {
      const LeftOutFrame& frame = frames[next(i)];
      real += frame.rms_m * frame.rms_m;
      predicted += frame.predicted_rms_m * frame.predicted_rms_m;
    }
    return std::sqrt(real / predicted);
  };
  ScatterRatio result;
  if (frames.empty()) return result;
  result.value = ratio([](size_t i) { return i; });
  std::mt19937 random(1);
  std::vector<double> resampled(2000);
  for (double& value : resampled) {
    value = ratio([&](size_t) { return random() % frames.size(); });
  }
  std::sort(resampled.begin(), resampled.end());
  result.low = resampled[50];
  result.high = resampled[1949];
  return result;
}

}  // namespace sightline
