// SPDX-License-Identifier: Apache-2.0
// Poses of camera, laser sheet and part for one measurement (ARCHITECTURE of the rig: thesis
// section 2.4.1 with the conventions of docs/architecture.md).
//
// World: x is the stage direction, z up; camera and laser look at the origin.
//   X_world = R_z(gamma) R_y(beta) R_x(alpha) (X_part - part_centre) + (s, offset_y, offset_z)
// with s the stage position. A placement of the part (Rig::part_placement) turns it before
// R_x(alpha) and says what part_centre is.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/rig/measurement.h"
#include "core/rig/rig.h"

namespace sightline {

// A sensor's axes in some frame: origin + x_axis * x + y_axis * y + z_axis * z, right-handed.
struct SensorPose {
  Eigen::Vector3d origin_m;
  Eigen::Vector3d x_axis;  // along the image rows and the laser line
  Eigen::Vector3d y_axis;  // along the image columns, downwards in the image
  Eigen::Vector3d z_axis;  // viewing direction

  // 4x4 matrix from sensor coordinates to the frame the axes are given in.
  Eigen::Matrix4d Matrix() const;
};

// Everything of a scan that does not depend on the part's mesh, in world coordinates.
struct ScanGeometry {
  SensorPose camera;
  SensorPose laser;
  // Laser sheet: n . x = 0 (it contains the origin); unit normal.
  Eigen::Vector3d sheet_normal;
  // X_world = part_rotation * (X_part - part_centre) + part_offset_m + s e_x.
  Eigen::Matrix3d part_rotation;
  Eigen::Vector3d part_offset_m;
  // Height of the part's lowest point relative to the centre that part_offset_m moves: upper face
  // of a table under the part. 0 without Rig::part_support_points_m.
  double table_height_m = 0;

  // Stage position at which the sheet passes through a part point that is at x_world with the
  // stage at 0: s = -(n . x_world) / n_x. Infinite or NaN when the sheet contains the scan
  // direction.
  double LitStagePosition(const Eigen::Vector3d& x_world) const {
    return -sheet_normal.dot(x_world) / sheet_normal.x();
  }
};

// Every measurement inside Table 2.1 gives a valid geometry; no check is made here.
ScanGeometry MakeScanGeometry(const Rig& rig, const Measurement& measurement);

// Displacement of a rigid body: turned about its own origin by a rotation vector, then shifted;
// axes of the world.
struct Displacement {
  Eigen::Vector3d rotation_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();

  Eigen::Matrix3d Rotation() const;
};

// Displacements of part, camera and laser from where the measurement of a scan has them. The part
// turns about the centre that offsets refer to.
struct ScanDisplacement {
  Displacement part, camera, laser;
};

// The sheet of the result holds the displaced laser instead of the origin, so LitStagePosition does
// not apply to it.
ScanGeometry Displaced(ScanGeometry geometry, const ScanDisplacement& displacement);

// World coordinates of a part point with the stage at `stage_m`.
Eigen::Vector3d PartToWorld(const ScanGeometry& geometry, const Eigen::Vector3d& part_centre_m,
                            const Eigen::Vector3d& x_part, double stage_m);

// A sensor pose in part (CAD) coordinates with the stage at `stage_m`.
SensorPose WorldToPart(const ScanGeometry& geometry, const Eigen::Vector3d& part_centre_m,
                       const SensorPose& pose, double stage_m);

// Limits that a measurement point must keep. AdmissibleDepth sets the interval of depths z [m]
// along the optical axis that satisfy the optional limits on lateral resolution (z / f_px <=
// max_pixel_footprint_m) and circle of confusion (D b |1/z_focus - 1/z| <= c p, thin lens focused
// at its focus distance, or at the camera distance if it has none; cf. thesis eq. 5.5).
struct PointLimits {
  double min_m = 0;
  double max_m = std::numeric_limits<double>::infinity();
  // Least cosine of the angles between the surface's normal and the directions to camera and laser.
  double min_cos_incidence = 0;
  // Largest product of depth and distance from the camera (MaxDepthTimesDistance).
  double max_depth_times_distance_m2 = std::numeric_limits<double>::infinity();
};
PointLimits AdmissibleDepth(const Rig& rig, double camera_distance_m,
                            std::optional<double> max_pixel_footprint_m,
                            std::optional<double> max_circle_of_confusion_px);

// A limit on depth per pixel, (z / f_px) / sin(angle between line of sight and laser plane), as one
// on depth z times distance r [m^2]: lit points lie in the plane, so the sine is b / r with b the
// distance of the camera from the plane, camera distance times sin(triangulation angle).
double MaxDepthTimesDistance(const Camera& camera, const Measurement& measurement,
                             double max_depth_per_pixel_m);

}  // namespace sightline
