// SPDX-License-Identifier: Apache-2.0
// Variance of the points of a scan along a direction, for the rig that measured them.
#pragma once

#include <Eigen/Core>

#include "core/rig/rig.h"
#include "core/rig/scan_geometry.h"
#include "core/triangulation/triangulation.h"
#include "core/uncertainty/uncertainty_model.h"

namespace sightline {

class ScanNoise {
 public:
  // `rig`, with the placement of its part, and `part_centre_m` say where the part lies
  // (MakeScanGeometry, PartToWorld).
  ScanNoise(const Rig& rig, const Measurement& measurement, const Eigen::Vector3d& part_centre_m,
            const UncertaintyModel& model);

  // Variance [m^2] along the unit vector `direction` of a point at `position_m` on a surface with
  // the unit normal `normal`, all in part coordinates: by noise of detection, of its own. Infinite
  // where the rig measures nothing.
  double DetectionVariance(const Eigen::Vector3d& position_m, const Eigen::Vector3d& normal,
                           const Eigen::Vector3d& direction) const;
  // The same in all directions: covariance [m^2] of the point, of rank 2 since it stays on the
  // sheet. Not finite where the rig measures nothing.
  Eigen::Matrix3d DetectionCovariance(const Eigen::Vector3d& position_m,
                                      const Eigen::Vector3d& normal) const;
  // By calibration, common to all points of the scan near there; 0 without calibration errors.
  double CalibrationVariance(const Eigen::Vector3d& position_m,
                             const Eigen::Vector3d& direction) const;

 private:
  TriangulationSetup SetupAt(const Eigen::Vector3d& position_m) const;

  Camera camera_;
  ScanGeometry geometry_;
  Eigen::Vector3d part_centre_m_;
  UncertaintyModel model_;
};

}  // namespace sightline
