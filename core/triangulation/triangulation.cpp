// SPDX-License-Identifier: Apache-2.0
#include "core/triangulation/triangulation.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/triangulation/calibration_derivatives.h"
#include "core/triangulation/error_model.h"

namespace sightline {

TriangulationSetup MakeTriangulationSetup(const Camera& camera, const SensorPose& camera_pose,
                                          const SensorPose& laser_pose) {
  return {camera_pose, laser_pose, camera.FocalLengthPx(),
          0.5 * Eigen::Vector2d(camera.columns_px, camera.rows_px)};
}

Eigen::Vector2d ProjectPoint(const TriangulationSetup& setup, const Eigen::Vector3d& point_m) {
  const Eigen::Vector3d from_pupil = point_m - setup.camera.origin_m;
  const double scale = setup.focal_length_px / from_pupil.dot(setup.camera.z_axis);
  return setup.principal_point_px + scale * Eigen::Vector2d(from_pupil.dot(setup.camera.x_axis),
                                                            from_pupil.dot(setup.camera.y_axis));
}

Eigen::Vector3d Triangulate(const TriangulationSetup& setup, const Eigen::Vector2d& image_px,
                            const TriangulationErrors& errors) {
  const ErrorModel model(setup, image_px);
  std::array<double, kTriangulationVariables> e;
  std::copy(errors.begin(), errors.end(), e.begin());
  const TriangulatedPoint<double> point = TriangulateWithErrors<double>(model, e);
  if (!(point.depth > 0) || !std::isfinite(point.depth)) {
    return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return model.pupil_m + model.to_camera.transpose() * Eigen::Vector3d(point.in_camera[0],
                                                                       point.in_camera[1],
                                                                       point.in_camera[2]);
}

// In the camera's axes, with P = X - c, k_1 = (1, 0, -x'), k_2 = (0, 1, -y'), true rotation R(w),
// position error p, source s and sheet offset o, the residual is
//   g_1 = R(w) k_1 . (P - p),  g_2 = R(w) k_2 . (P - p),  g_3 = n' . (P - s) - o,
// and M = (k_1, k_2, n)' at zero errors. Differentiated at fixed P:
//   dg_i/dw = k_i x P,  dg_i/dp = -k_i,  dg_1/dx' = -z,
//   dg_3/dt_x = z_laser . (P - s),  dg_3/dt_z = -x_laser . (P - s),  dg_3/do = -1.
Eigen::Matrix<double, 3, kTriangulationVariables> PointDerivatives(
    const TriangulationSetup& setup, const Eigen::Vector2d& image_px) {
  const ErrorModel model(setup, image_px);
  const Eigen::Vector3d ray = model.Ray();
  const double z = model.sheet_normal.dot(model.source) / model.sheet_normal.dot(ray);
  if (!(z > 0) || !std::isfinite(z)) {
    return Eigen::Matrix<double, 3, kTriangulationVariables>::Constant(
        std::numeric_limits<double>::quiet_NaN());
  }
  const Eigen::Vector3d point = z * ray;
  const Eigen::Vector3d from_source = point - model.source;
  const double f = model.focal_length_px;

  Eigen::Matrix3d m;
  m << 1, 0, -ray.x(), 0, 1, -ray.y(), model.sheet_normal.transpose();
  Eigen::Matrix<double, 3, kTriangulationVariables> residual =
      Eigen::Matrix<double, 3, kTriangulationVariables>::Zero();
  constexpr TriangulationVariable kImage[2] = {kImageX, kImageY};
  constexpr TriangulationVariable kPrincipal[2] = {kPrincipalX, kPrincipalY};
  for (int row = 0; row < 2; ++row) {
    const Eigen::Vector3d k = m.row(row);
    residual(row, kImage[row]) = -z / f;
    residual(row, kPrincipal[row]) = z / f;
    residual(row, kFocalLengthError) = z * ray[row] / f;
    residual.block<1, 3>(row, kCameraAlpha) = k.cross(point).transpose();
    residual.block<1, 3>(row, kCameraX) = -k.transpose();
  }
  residual(2, kSheetTiltX) = model.sheet_z.dot(from_source);
  residual(2, kSheetTiltZ) = -model.sheet_x.dot(from_source);
  residual(2, kSheetOffset) = -1;
  return -(model.to_camera.transpose() * m.inverse() * residual);
}

Eigen::Matrix3d FirstOrderCovariance(const TriangulationSetup& setup,
                                     const Eigen::Vector2d& image_px,
                                     const TriangulationCovariance& covariance) {
  const Eigen::Matrix<double, 3, kTriangulationVariables> j = PointDerivatives(setup, image_px);
  return j * covariance * j.transpose();
}

CalibrationRow CalibrationDerivatives(const TriangulationSetup& setup,
                                      const Eigen::Vector3d& position_m,
                                      const Eigen::Vector3d& normal) {
  const auto derivatives = PointDerivatives(setup, ProjectPoint(setup, position_m));
  return normal.transpose() * derivatives.rightCols<kCalibrationVariables>();
}

}  // namespace sightline
