// SPDX-License-Identifier: Apache-2.0
#include "core/rig/scan_geometry.h"

#include <algorithm>
#include <cmath>

#include "core/rig/measurement.h"
#include "core/rig/rig.h"

namespace sightline {

std::array<double, kMeasurementParameters> ToArray(const Measurement& m) {
  return {m.camera_distance_m, m.triangulation_angle_rad, m.camera_azimuth_rad, m.camera_polar_rad,
          m.part_alpha_rad,    m.part_beta_rad,           m.part_gamma_rad,     m.offset_y_m,
          m.offset_z_m};
}

Measurement FromArray(const std::array<double, kMeasurementParameters>& p) {
  return {p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8]};
}

double Camera::FocalLengthPx() const { return 0.5 * rows_px / std::tan(0.5 * vertical_fov_rad); }

Eigen::Matrix4d SensorPose::Matrix() const {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.block<3, 1>(0, 0) = x_axis;
  m.block<3, 1>(0, 1) = y_axis;
  m.block<3, 1>(0, 2) = z_axis;
  m.block<3, 1>(0, 3) = origin_m;
  return m;
}

namespace {

SensorPose LookAtOrigin(double distance_m, double polar_rad, double azimuth_rad) {
  const double sp = std::sin(polar_rad), cp = std::cos(polar_rad);
  const double sa = std::sin(azimuth_rad), ca = std::cos(azimuth_rad);
  const Eigen::Vector3d direction(sp * ca, sp * sa, cp);
  SensorPose pose;
  pose.origin_m = distance_m * direction;
  pose.x_axis = Eigen::Vector3d(-sa, ca, 0);
  pose.z_axis = -direction;
  pose.y_axis = pose.z_axis.cross(pose.x_axis);
  return pose;
}

}  // namespace

ScanGeometry MakeScanGeometry(const Rig& rig, const Measurement& m) {
  ScanGeometry g;
  g.camera = LookAtOrigin(m.camera_distance_m, m.camera_polar_rad, m.camera_azimuth_rad);
  g.laser = LookAtOrigin(rig.laser.distance_m.value_or(m.camera_distance_m),
                         m.camera_polar_rad - m.triangulation_angle_rad, m.camera_azimuth_rad);
  // The sheet holds the laser's viewing axis and the line direction e = x_axis.
  g.sheet_normal = g.laser.y_axis;
  g.part_rotation = (Eigen::AngleAxisd(m.part_gamma_rad, Eigen::Vector3d::UnitZ()) *
                     Eigen::AngleAxisd(m.part_beta_rad, Eigen::Vector3d::UnitY()) *
                     Eigen::AngleAxisd(m.part_alpha_rad, Eigen::Vector3d::UnitX()))
                        .toRotationMatrix();
  if (rig.part_placement) g.part_rotation = g.part_rotation * rig.part_placement->rotation;
  g.part_offset_m = Eigen::Vector3d(0, m.offset_y_m, m.offset_z_m);
  if (rig.part_support_points_m != nullptr && !rig.part_support_points_m->empty()) {
    const Eigen::Vector3d up = g.part_rotation.row(2);
    g.table_height_m = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& corner : *rig.part_support_points_m) {
      g.table_height_m = std::min(g.table_height_m, up.dot(corner));
    }
  }
  return g;
}

Eigen::Matrix3d Displacement::Rotation() const {
  const double angle_rad = rotation_rad.norm();
  if (angle_rad == 0) return Eigen::Matrix3d::Identity();
  return Eigen::AngleAxisd(angle_rad, rotation_rad / angle_rad).toRotationMatrix();
}

ScanGeometry Displaced(ScanGeometry g, const ScanDisplacement& displacement) {
  const auto displace = [](const Displacement& by, SensorPose& pose) {
    const Eigen::Matrix3d turn = by.Rotation();
    pose.origin_m += by.translation_m;
    pose.x_axis = turn * pose.x_axis;
    pose.y_axis = turn * pose.y_axis;
    pose.z_axis = turn * pose.z_axis;
  };
  displace(displacement.camera, g.camera);
  displace(displacement.laser, g.laser);
  g.sheet_normal = g.laser.y_axis;
  g.part_rotation = displacement.part.Rotation() * g.part_rotation;
  g.part_offset_m += displacement.part.translation_m;
  return g;
}

Eigen::Vector3d PartToWorld(const ScanGeometry& g, const Eigen::Vector3d& part_centre_m,
                            const Eigen::Vector3d& x_part, double stage_m) {
  return g.part_rotation * (x_part - part_centre_m) + g.part_offset_m +
         stage_m * Eigen::Vector3d::UnitX();
}

SensorPose WorldToPart(const ScanGeometry& g, const Eigen::Vector3d& part_centre_m,
                       const SensorPose& pose, double stage_m) {
  const Eigen::Matrix3d to_part = g.part_rotation.transpose();
  SensorPose result;
  result.origin_m =
      to_part * (pose.origin_m - g.part_offset_m - stage_m * Eigen::Vector3d::UnitX()) +
      part_centre_m;
  result.x_axis = to_part * pose.x_axis;
  result.y_axis = to_part * pose.y_axis;
  result.z_axis = to_part * pose.z_axis;
  return result;
}

PointLimits AdmissibleDepth(const Rig& rig, double camera_distance_m,
                            std::optional<double> max_pixel_footprint_m,
                            std::optional<double> max_circle_of_confusion_px) {
  PointLimits depth;
  if (max_pixel_footprint_m) depth.max_m = *max_pixel_footprint_m * rig.camera.FocalLengthPx();
  if (max_circle_of_confusion_px.value_or(0) > 0 && rig.lens && rig.camera.pixel_pitch_m) {
    const double pupil_m = rig.lens->focal_length_m / rig.lens->f_number;
    const double focus_distance_m = rig.lens->focus_distance_m.value_or(camera_distance_m);
    const double image_distance_m = 1 / (1 / rig.lens->focal_length_m - 1 / focus_distance_m);
    const double limit =
        *max_circle_of_confusion_px * *rig.camera.pixel_pitch_m / (pupil_m * image_distance_m);
    const double focus = 1 / focus_distance_m;
    depth.min_m = std::max(depth.min_m, 1 / (focus + limit));
    if (focus > limit) depth.max_m = std::min(depth.max_m, 1 / (focus - limit));
  }
  return depth;
}

double MaxDepthTimesDistance(const Camera& camera, const Measurement& m,
                             double max_depth_per_pixel_m) {
  return max_depth_per_pixel_m * camera.FocalLengthPx() * m.camera_distance_m *
         std::abs(std::sin(m.triangulation_angle_rad));
}

}  // namespace sightline
