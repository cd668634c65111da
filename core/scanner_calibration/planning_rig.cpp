// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/planning_rig.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "core/triangulation/triangulation.h"

namespace sightline {
namespace {

constexpr int kCalibrationVariables = kTriangulationVariables - kCameraAlpha;

// Typical sizes of the variables, so that rotations and lengths count alike.
Eigen::VectorXd TypicalSizes() {
  Eigen::VectorXd size(kCalibrationVariables);
  size << 1e-3, 1e-3, 1e-3, 1e-4, 1e-4, 1e-4, 1e-3, 1e-3, 1e-4, 1, 1, 1;
  return size;
}

// Image positions whose rays meet the laser plane in front of the camera, over the whole image.
std::vector<Eigen::Vector2d> SeenPositions(const AdjustedRig& rig, int columns_px, int rows_px) {
  std::vector<Eigen::Vector2d> positions;
  for (int i = 0; i < 7; ++i) {
    for (int j = 0; j < 7; ++j) {
      const Eigen::Vector2d at((i + 0.5) / 7 * columns_px, (j + 0.5) / 7 * rows_px);
      if (PointOnPlane(rig.shared, at).z() > 0) positions.push_back(at);
    }
  }
  return positions;
}

// Distance of the camera from the laser plane along the viewing ray of the image's centre [m], and
// the angle between this ray and the plane [rad].
Eigen::Vector2d DistanceAndAngle(const Eigen::VectorXd& shared, const Eigen::Vector2d& centre_px) {
  const Eigen::Vector3d origin = PointOnPlane(shared, centre_px);
  const Eigen::Vector3d normal = shared.segment<3>(kPlaneX).normalized();
  return {origin.norm(), std::asin(std::min(1.0, std::abs(normal.dot(origin.normalized()))))};
}

// First-order propagation with one-sided differences of a tenth of each standard error.
void SetErrors(const AdjustedRig& rig, const Eigen::Vector2d& centre_px, PlanningRig* described) {
  const Eigen::Vector2d nominal = DistanceAndAngle(rig.shared, centre_px);
  Eigen::MatrixXd derivatives = Eigen::MatrixXd::Zero(2, kSharedParameters);
  for (int i = 0; i < kSharedParameters; ++i) {
    const double step = 0.1 * std::sqrt(rig.covariance(i, i));
    if (!(step > 0)) continue;
    Eigen::VectorXd moved = rig.shared;
    moved[i] += step;
    derivatives.col(i) = (DistanceAndAngle(moved, centre_px) - nominal) / step;
  }
  const Eigen::Matrix2d covariance = derivatives * rig.covariance * derivatives.transpose();
  described->camera_distance_error_m = std::sqrt(covariance(0, 0));
  described->triangulation_angle_error_rad = std::sqrt(covariance(1, 1));
}

}  // namespace

absl::StatusOr<PlanningRig> DescribeForPlanning(const AdjustedRig& rig, int columns_px,
                                                int rows_px) {
  const TargetCamera camera = CameraOf(rig.shared);
  const Eigen::Vector2d centre(0.5 * (columns_px - 1), 0.5 * (rows_px - 1));
  const Eigen::Vector3d origin = PointOnPlane(rig.shared, centre);
  if (!(origin.z() > 0) || !(origin.norm() < 100)) {
    return absl::InvalidArgumentError("the middle of the image does not see the laser plane");
  }
  const Eigen::Vector3d axis = origin.normalized();
  const Eigen::Vector3d normal = rig.shared.segment<3>(kPlaneX).normalized();
  Eigen::Vector3d x = axis.cross(normal).normalized();
  Eigen::Vector3d laser_axis = normal.cross(x);
  if (laser_axis.dot(axis) < 0) laser_axis = -laser_axis;
  if (laser_axis.dot(axis.cross(x)) < 0) x = -x;
  const Eigen::Vector3d y = axis.cross(x);

  PlanningRig described;
  described.columns_px = columns_px;
  described.rows_px = rows_px;
  if (std::abs(y.x()) > std::abs(y.y())) std::swap(described.columns_px, described.rows_px);
  described.focal_length_px = std::sqrt(camera.fx * camera.fy);
  described.camera_distance_m = origin.norm();
  described.triangulation_angle_rad = std::acos(std::clamp(laser_axis.dot(axis), -1.0, 1.0));

  SetErrors(rig, centre, &described);

  TriangulationSetup setup;
  setup.camera = {.origin_m = Eigen::Vector3d::Zero(), .x_axis = x, .y_axis = y, .z_axis = axis};
  setup.laser = {.origin_m = origin - described.camera_distance_m * laser_axis,
                 .x_axis = x,
                 .y_axis = laser_axis.cross(x),
                 .z_axis = laser_axis};
  setup.focal_length_px = described.focal_length_px;
  setup.principal_point_px = {0.5 * described.columns_px, 0.5 * described.rows_px};

  const std::vector<Eigen::Vector2d> positions = SeenPositions(rig, columns_px, rows_px);
  const auto rows = 3 * static_cast<Eigen::Index>(positions.size());
  Eigen::MatrixXd by_shared = Eigen::MatrixXd::Zero(rows, kSharedParameters);
  Eigen::MatrixXd by_variable(rows, kCalibrationVariables);
  const Eigen::VectorXd sizes = TypicalSizes();
  for (size_t k = 0; k < positions.size(); ++k) {
    const auto at = 3 * static_cast<Eigen::Index>(k);
    const Eigen::Vector3d point = PointOnPlane(rig.shared, positions[k]);
    by_variable.middleRows<3>(at) =
        PointDerivatives(setup, ProjectPoint(setup, point)).rightCols<kCalibrationVariables>() *
        sizes.asDiagonal();
    for (int i = 0; i < kSharedParameters; ++i) {
      const double step = 0.1 * std::sqrt(rig.covariance(i, i));
      if (!(step > 0)) continue;
      Eigen::VectorXd moved = rig.shared;
      moved[i] += step;
      by_shared.block<3, 1>(at, i) = (PointOnPlane(moved, positions[k]) - point) / step;
    }
  }
  // Some variables do nearly the same (principal point and rotation): the smallest that do it.
  Eigen::JacobiSVD<Eigen::MatrixXd> svd(by_variable, Eigen::ComputeThinU | Eigen::ComputeThinV);
  svd.setThreshold(1e-6);
  const Eigen::MatrixXd transfer = svd.solve(by_shared);
  const Eigen::MatrixXd missed = by_variable * transfer - by_shared;
  described.covariance_misfit =
      std::sqrt((missed * rig.covariance * missed.transpose()).trace() /
                (by_shared * rig.covariance * by_shared.transpose()).trace());
  const Eigen::MatrixXd scaled = sizes.asDiagonal() * transfer;
  described.covariance = scaled * rig.covariance * scaled.transpose();
  described.covariance = (0.5 * (described.covariance + described.covariance.transpose())).eval();
  return described;
}

}  // namespace sightline
