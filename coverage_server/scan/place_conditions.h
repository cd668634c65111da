// SPDX-License-Identifier: Apache-2.0
// Conditions that a place of the surface must meet in the frame that lights it. The exact evaluator
// checks them for every measurement point; explanations name the violated one.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "core/rig/scan_geometry.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/scan/scan_in_part.h"

namespace sightline {

// Length left out at a segment's end so that a point is not hidden by its own surface.
inline constexpr float kSurfaceGapM = 2e-5f;
// Parts of the line nearer to the camera than this are not imaged.
inline constexpr double kNearPlaneM = 1e-3;

// Vectors `from_camera` and `from_laser` lead to the place, in part coordinates.

inline double DepthOf(const ScanInPart& scan, const Eigen::Vector3d& from_camera) {
  return from_camera.dot(scan.camera.z_axis);
}

inline bool WithinDepth(const PointLimits& admissible, double depth_m) {
  return depth_m >= admissible.min_m && depth_m <= admissible.max_m;
}

// True if the place keeps the limit on depth per pixel (MaxDepthTimesDistance).
inline bool FineInDepth(const PointLimits& admissible, const Eigen::Vector3d& from_camera,
                        double depth_m) {
  return depth_m * from_camera.norm() <= admissible.max_depth_times_distance_m2;
}

// True if the surface keeps the limit on incidence for a sensor. `normal` of any length;
// `to_sensor` leads to the sensor.
inline bool WithinIncidence(const PointLimits& limits, const Eigen::Vector3d& normal,
                            const Eigen::Vector3d& to_sensor) {
  return limits.min_cos_incidence <= 0 ||
         normal.dot(to_sensor) >= limits.min_cos_incidence * normal.norm() * to_sensor.norm();
}

inline bool InRows(const ScanInPart& scan, const Eigen::Vector3d& from_camera, double depth_m) {
  return std::abs(from_camera.dot(scan.camera.y_axis)) <=
         scan.half_rows_px / scan.focal_length_px * depth_m;
}

inline bool InColumns(const ScanInPart& scan, const Eigen::Vector3d& from_camera, double depth_m) {
  return std::abs(from_camera.dot(scan.camera.x_axis)) <=
         scan.half_columns_px / scan.focal_length_px * depth_m;
}

inline bool InRange(const ScanInPart& scan, const Eigen::Vector3d& from_camera) {
  return from_camera.squaredNorm() <= scan.max_range_m * scan.max_range_m;
}

inline bool InFan(const ScanInPart& scan, const Eigen::Vector3d& from_laser) {
  const double depth_m = from_laser.dot(scan.laser.z_axis);
  return depth_m > 0 && std::abs(from_laser.dot(scan.laser.x_axis)) <= scan.fan_tangent * depth_m;
}

// Moves a point from part coordinates (stage position s) into an occluder's frame.
struct FrameChange {
  Eigen::Matrix3f rotation;
  Eigen::Vector3f shift;
  Eigen::Vector3f operator()(const Eigen::Vector3f& x) const { return rotation * x + shift; }
};

inline FrameChange FromPart(ObstacleFrame frame, const ScanGeometry& geometry,
                            const Eigen::Vector3d& part_centre_m, double stage_m) {
  if (frame == ObstacleFrame::kPart) return {Eigen::Matrix3f::Identity(), Eigen::Vector3f::Zero()};
  Eigen::Vector3d shift = -(geometry.part_rotation * part_centre_m);
  if (frame == ObstacleFrame::kWorld)
    shift += geometry.part_offset_m + Eigen::Vector3d(stage_m, 0, 0);
  if (frame == ObstacleFrame::kTable) shift.z() -= geometry.table_height_m;
  return {geometry.part_rotation.cast<float>(), shift.cast<float>()};
}

// True if the occluder hides a place from a sensor; both in part coordinates.
inline bool Hides(const Occluder& occluder, const FrameChange& change,
                  const Eigen::Vector3f& sensor, const Eigen::Vector3f& place) {
  return occluder.bvh.Occluded(change(sensor), change(place), kSurfaceGapM);
}

}  // namespace sightline
