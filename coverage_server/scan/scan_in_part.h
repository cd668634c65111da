// SPDX-License-Identifier: Apache-2.0
// A scan in part coordinates, in which every quantity is linear in the part point and the sensors
// move by -s X with the stage position s.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/rig/scan_geometry.h"

namespace sightline {

// A box that travels with the stage. A point p in part coordinates is rotation p + shift in the
// axes of the box.
struct TravellingBox {
  Eigen::Matrix3f rotation;
  Eigen::Vector3f shift;
  Eigen::Vector3f low, high;
  // False if the box lies below the part and the sensor above its top: it then hides nothing.
  bool hides_camera, hides_laser;
};

struct ScanInPart {
  // Camera and laser with the stage at 0.
  SensorPose camera;
  SensorPose laser;
  Eigen::Vector3d scan_direction;  // X: the world's x axis in part coordinates
  // Lit stage position of a part point: s = lit_gradient . p + lit_offset_m.
  Eigen::Vector3d lit_gradient;
  double lit_offset_m;
  Eigen::Vector3d sheet_normal;
  double sheet_normal_x;  // |n . e_x|: how fast the sheet crosses the part
  double max_range_m;
  double fan_tangent;  // tan(half fan angle)
  double focal_length_px;
  double half_columns_px, half_rows_px;
  double scan_step_m;
  PointLimits depth;  // limits by resolution and defocus
  // The obstacle boxes that can hide a sensor from the part.
  std::vector<TravellingBox> boxes;
  // False if the laser sheet contains the scan direction: the scan then sweeps no volume.
  bool sweeps;
};

inline ScanInPart MakeScanInPart(const Rig& rig, const Eigen::Vector3d& part_centre_m,
                                 const ScanGeometry& g, const PointLimits& depth) {
  ScanInPart scan;
  scan.camera = WorldToPart(g, part_centre_m, g.camera, 0);
  scan.laser = WorldToPart(g, part_centre_m, g.laser, 0);
  scan.scan_direction = g.part_rotation.transpose().col(0);
  scan.sheet_normal = g.part_rotation.transpose() * g.sheet_normal;
  const double nx = g.sheet_normal.x();
  scan.sheet_normal_x = std::abs(nx);
  scan.sweeps = scan.sheet_normal_x > 1e-6;
  scan.lit_gradient = -scan.sheet_normal / nx;
  // The sheet contains the laser source at every stage position.
  scan.lit_offset_m = scan.sheet_normal.dot(scan.laser.origin_m) / nx;
  scan.max_range_m = rig.max_range_m;
  scan.fan_tangent = std::tan(0.5 * rig.laser.fan_angle_rad);
  scan.focal_length_px = rig.camera.FocalLengthPx();
  scan.half_columns_px = 0.5 * rig.camera.columns_px;
  scan.half_rows_px = 0.5 * rig.camera.rows_px;
  scan.scan_step_m = rig.scan_step_m;
  scan.depth = depth;
  return scan;
}

inline ScanInPart MakeScanInPart(const Rig& rig, const Eigen::Vector3d& part_centre_m,
                                 const Measurement& measurement, const PointLimits& depth) {
  return MakeScanInPart(rig, part_centre_m, MakeScanGeometry(rig, measurement), depth);
}

}  // namespace sightline
