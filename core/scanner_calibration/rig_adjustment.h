// SPDX-License-Identifier: Apache-2.0
// Camera, laser plane and target from corners and line of all frames at once (bundle adjustment).
//
// Residuals: corners about their projections, over the corners' standard deviation; samples of the
// line as distances from the laser plane of the points where their rays meet the target's surface,
// over the standard deviation that the scatter of the samples causes there. Both standard
// deviations are scaled by the root of chi^2 per degree of freedom of their own kind in a second
// adjustment (Birge ratio), where that exceeds 1.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/scanner_calibration/line_in_frame.h"
#include "core/scanner_calibration/target_camera.h"

namespace sightline {

struct TargetBoard {
  int inner_corners_x = 0, inner_corners_y = 0;
  double square_m = 0;

  // Corner i, row by row, from the middle of the corners [m]; z = 0.
  Eigen::Vector2d Corner(int i) const {
    return {(i % inner_corners_x - 0.5 * (inner_corners_x - 1)) * square_m,
            (i / inner_corners_x - 0.5 * (inner_corners_y - 1)) * square_m};
  }
  int corner_count() const { return inner_corners_x * inner_corners_y; }
};

// Surfaces that corners and line lie on. A bent sheet on a flat plate, or a plate that is bent
// itself, moves all poses alike, which changes focal length and laser plane.
enum class TargetShape {
  kFlat,
  kBentBoard,  // corners on z = xx x^2 + xy x y + yy y^2, the line on the plane z = 0
  kBent        // both on the bent surface
};

struct CalibrationFrame {
  std::string name;
  std::vector<Eigen::Vector2d> corners_px;  // row by row
  Eigen::VectorXd pose;                     // start: MotionOf, middle of the corners to camera
  LineInFrame line;
};

struct CameraPrior {
  TargetCamera camera;  // start
  // Prior standard deviations of the shared parameters up to kRadial3: 0 holds one, infinity leaves
  // it to the frames.
  std::array<double, 9> standard_deviation{};
};

struct AdjustedRig {
  Eigen::VectorXd shared;      // SharedParameter
  Eigen::MatrixXd covariance;  // of them
  std::vector<Eigen::VectorXd> poses;
  double corner_sd_px = 0;  // of a corner along each axis, from the residuals
  double line_scale = 1;    // real scatter of the line samples over that of short pieces
};

// Nine or more corners and one frame determine nothing: at least three frames. INVALID_ARGUMENT:
// the frames do not determine the rig, for instance because all show the target in the same
// position.
absl::StatusOr<AdjustedRig> AdjustRig(const TargetBoard& board,
                                      const std::vector<CalibrationFrame>& frames,
                                      const CameraPrior& prior, TargetShape shape);

// Pose of the target in one frame from its corners alone, for given shared parameters, and its
// covariance for corners of this standard deviation.
struct TargetPose {
  Eigen::VectorXd pose;
  Eigen::MatrixXd covariance;
  double rms_px = 0;
};
absl::StatusOr<TargetPose> PoseOfTarget(const TargetBoard& board, const CalibrationFrame& frame,
                                        const Eigen::VectorXd& shared, double corner_sd_px);

// Point where the ray of an image position meets the laser plane [m].
Eigen::Vector3d PointOnPlane(const Eigen::VectorXd& shared, const Eigen::Vector2d& image_px);

// Height of a point over the surface that the line lies on [m].
double HeightOverTarget(TargetShape shape, const Eigen::VectorXd& shared,
                        const Eigen::VectorXd& pose, const Eigen::Vector3d& point_m);

}  // namespace sightline
