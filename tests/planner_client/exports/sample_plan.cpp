// SPDX-License-Identifier: Apache-2.0
#include "tests/planner_client/exports/sample_plan.h"

#include "core/inspection/inspection.h"
#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

v1::Pose ToPose(const Eigen::Matrix4d& matrix) {
  v1::Pose pose;
  for (int i = 0; i < 16; ++i) pose.add_matrix(matrix(i / 4, i % 4));
  return pose;
}

v1::PlannedScan MakeScan(int index, const Measurement& measurement, int first, int last) {
  const Rig rig = SampleRig();
  const ScanGeometry geometry = MakeScanGeometry(rig, measurement);
  v1::PlannedScan scan;
  scan.set_index(index);
  *scan.mutable_measurement() = MeasurementToProto(measurement);
  const double start_m = last >= first ? first * rig.scan_step_m : 0;
  scan.set_stage_start_m(start_m);
  scan.set_stage_end_m(last >= first ? last * rig.scan_step_m : 0);
  for (int frame = first; frame <= last; ++frame) {
    scan.add_trigger_positions_m(frame * rig.scan_step_m);
  }
  *scan.mutable_camera_pose() =
      ToPose(WorldToPart(geometry, kSampleCentre_m, geometry.camera, start_m).Matrix());
  *scan.mutable_laser_pose() =
      ToPose(WorldToPart(geometry, kSampleCentre_m, geometry.laser, start_m).Matrix());
  Eigen::Matrix4d part = Eigen::Matrix4d::Identity();
  part.topLeftCorner<3, 3>() = geometry.part_rotation;
  part.topRightCorner<3, 1>() = geometry.part_offset_m - geometry.part_rotation * kSampleCentre_m;
  *scan.mutable_part_pose() = ToPose(part);
  return scan;
}

}  // namespace

Rig SampleRig() {
  Rig rig;
  rig.scan_step_m = 5e-4;
  rig.laser.distance_m = 0.55;
  return rig;
}

v1::Plan SamplePlan() {
  v1::Plan plan;
  plan.set_inspection_name("bracket, <station> \"3\"");
  plan.set_part_digest("0123456789abcdef");
  plan.mutable_coverage()->set_measurable_targets(1000);
  plan.mutable_coverage()->set_coverage(0.9);
  *plan.add_scans() = MakeScan(1,
                               {.camera_distance_m = 0.4,
                                .triangulation_angle_rad = 0.5,
                                .camera_azimuth_rad = 0,
                                .camera_polar_rad = 0,
                                .offset_z_m = 0.02},
                               -111, 95);
  *plan.add_scans() = MakeScan(2,
                               {.camera_distance_m = 0.31,
                                .triangulation_angle_rad = -0.7,
                                .camera_azimuth_rad = 4.1,
                                .camera_polar_rad = 0.9,
                                .part_alpha_rad = 1.1,
                                .part_beta_rad = 5.2,
                                .part_gamma_rad = 2.3,
                                .offset_y_m = -0.04,
                                .offset_z_m = 0.013},
                               -7, 401);
  *plan.add_scans() = MakeScan(3,
                               {.camera_distance_m = 0.5,
                                .triangulation_angle_rad = 0.3,
                                .part_beta_rad = 1.5707963267948966},
                               0, -1);
  return plan;
}

}  // namespace sightline
