// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/uncertainty/calibration_variance.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {

CalibrationVariance::CalibrationVariance(const ScanInPart& scan,
                                         const TriangulationCovariance& covariance)
    : x_axis_(scan.camera.x_axis.cast<float>()),
      y_axis_(scan.camera.y_axis.cast<float>()),
      z_axis_(scan.camera.z_axis.cast<float>()) {
  if (covariance.isZero(0)) return;
  constexpr int kVariables = kTriangulationVariables - kCameraAlpha;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, kVariables, kVariables>> solver(
      covariance.bottomRightCorner<kVariables, kVariables>());
  const Eigen::Matrix<double, kVariables, kVariables> root =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(0).cwiseSqrt().asDiagonal();
  // The frame at stage position 0, in part axes.
  const TriangulationSetup setup{scan.camera, scan.laser, scan.focal_length_px,
                                 Eigen::Vector2d(scan.half_columns_px, scan.half_rows_px)};
  columns_to_grid_ =
      static_cast<float>(0.5 * (kSide - 1) * scan.focal_length_px / scan.half_columns_px);
  rows_to_grid_ = static_cast<float>(0.5 * (kSide - 1) * scan.focal_length_px / scan.half_rows_px);
  grid_.reserve(size_t{kSide} * kSide);
  for (int row = 0; row < kSide; ++row) {
    for (int column = 0; column < kSide; ++column) {
      const Eigen::Vector2d image(2 * scan.half_columns_px * column / (kSide - 1),
                                  2 * scan.half_rows_px * row / (kSide - 1));
      const Eigen::Matrix<double, 3, kTriangulationVariables> derivatives =
          PointDerivatives(setup, image);
      grid_.emplace_back((derivatives.rightCols<kVariables>() * root).transpose().cast<float>());
    }
  }
}

float CalibrationVariance::At(const Eigen::Vector3f& view_m, const Eigen::Vector3f& normal) const {
  const float depth = view_m.dot(z_axis_);
  constexpr float kLast = kSide - 1;
  const float u =
      std::clamp(view_m.dot(x_axis_) / depth * columns_to_grid_ + 0.5f * kLast, 0.0f, kLast);
  const float v =
      std::clamp(view_m.dot(y_axis_) / depth * rows_to_grid_ + 0.5f * kLast, 0.0f, kLast);
  const int column = std::min(static_cast<int>(u), kSide - 2);
  const int row = std::min(static_cast<int>(v), kSide - 2);
  const float a = u - static_cast<float>(column), b = v - static_cast<float>(row);
  const auto along = [&](int r, int c) -> Eigen::Matrix<float, Factor::RowsAtCompileTime, 1> {
    return grid_[r * kSide + c] * normal;
  };
  const float variance = ((1 - b) * ((1 - a) * along(row, column) + a * along(row, column + 1)) +
                          b * ((1 - a) * along(row + 1, column) + a * along(row + 1, column + 1)))
                             .squaredNorm();
  // If the rays run along the laser sheet, no point is reconstructed and there is no information.
  return std::isfinite(variance) ? variance : std::numeric_limits<float>::infinity();
}

}  // namespace sightline
