// SPDX-License-Identifier: Apache-2.0
#include "core/registration/scan_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {

ScanNoise::ScanNoise(const Rig& rig, const Measurement& measurement,
                     const Eigen::Vector3d& part_centre_m, const UncertaintyModel& model)
    : camera_(rig.camera),
      geometry_(MakeScanGeometry(rig, measurement)),
      part_centre_m_(part_centre_m),
      model_(model) {}

TriangulationSetup ScanNoise::SetupAt(const Eigen::Vector3d& position_m) const {
  const double stage_m =
      geometry_.LitStagePosition(PartToWorld(geometry_, part_centre_m_, position_m, 0));
  return MakeTriangulationSetup(camera_,
                                WorldToPart(geometry_, part_centre_m_, geometry_.camera, stage_m),
                                WorldToPart(geometry_, part_centre_m_, geometry_.laser, stage_m));
}

double ScanNoise::DetectionVariance(const Eigen::Vector3d& position_m,
                                    const Eigen::Vector3d& normal,
                                    const Eigen::Vector3d& direction) const {
  const TriangulationSetup setup = SetupAt(position_m);
  const Eigen::Vector3d view = position_m - setup.camera.origin_m;
  const double depth_m = view.dot(setup.camera.z_axis);
  const Eigen::Vector2d by_image = ImageDerivativesAlong(
      direction, setup.camera, setup.focal_length_px, setup.laser.y_axis, view / depth_m, depth_m);
  const double distance_m = view.norm();
  const double cosine = std::clamp(-view.dot(normal) / distance_m, -1.0, 1.0);
  const double noise_px = model_.detection.At(distance_m, std::acos(cosine));
  const double variance_m2 = noise_px * noise_px * by_image.squaredNorm();
  return std::isfinite(variance_m2) ? variance_m2 : std::numeric_limits<double>::infinity();
}

Eigen::Matrix3d ScanNoise::DetectionCovariance(const Eigen::Vector3d& position_m,
                                               const Eigen::Vector3d& normal) const {
  const TriangulationSetup setup = SetupAt(position_m);
  const auto derivatives = PointDerivatives(setup, ProjectPoint(setup, position_m));
  const TriangulationCovariance errors =
      sightline::DetectionCovariance(model_, setup.camera, position_m, normal);
  const Eigen::Matrix<double, 3, 2> by_image = derivatives.leftCols<2>();
  return by_image * errors.topLeftCorner<2, 2>() * by_image.transpose();
}

double ScanNoise::CalibrationVariance(const Eigen::Vector3d& position_m,
                                      const Eigen::Vector3d& direction) const {
  if (!model_.HasCalibrationErrors()) return 0;
  const TriangulationSetup setup = SetupAt(position_m);
  const Eigen::RowVectorXd along =
      direction.transpose() * PointDerivatives(setup, ProjectPoint(setup, position_m));
  const double variance_m2 = (along * model_.calibration).dot(along);
  return std::isfinite(variance_m2) ? std::max(0.0, variance_m2)
                                    : std::numeric_limits<double>::infinity();
}

}  // namespace sightline
