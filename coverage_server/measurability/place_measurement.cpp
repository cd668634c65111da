// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/measurability/place_measurement.h"

#include <algorithm>
#include <cmath>

#include "core/rig/scan_geometry.h"
#include "core/rig/sensor_bodies.h"
#include "coverage_server/scan/place_conditions.h"
#include "coverage_server/scan/scan_in_part.h"

namespace sightline {

PlaceMeasurement::PlaceMeasurement(const Rig& rig, const TargetSampling& sampling,
                                   const Eigen::Vector3d& part_centre_m,
                                   const std::vector<Occluder>& occluders, const Occluder* table,
                                   const LightLimit* light)
    : rig_(rig),
      sampling_(sampling),
      part_centre_m_(part_centre_m),
      occluders_(occluders),
      table_(table),
      light_(light) {
  rig_.part_support_points_m.reset();
}

bool PlaceMeasurement::TouchesTable(const ScanGeometry& geometry) const {
  const auto touches = [&](const std::vector<Body>& bodies, const SensorPose& pose) {
    return std::any_of(bodies.begin(), bodies.end(), [&](const Body& body) {
      Zonotope solid = BodyAt(WithMargin(body, rig_.clearance_m), pose);
      solid.centre_m -= geometry.part_offset_m;
      solid.centre_m.z() -= geometry.table_height_m;
      return table_->bvh.Overlaps(solid);
    });
  };
  return touches(rig_.camera_bodies, geometry.camera) || touches(rig_.laser_bodies, geometry.laser);
}

bool PlaceMeasurement::Measures(const Measurement& measurement, double table_height_m,
                                const Eigen::Vector3d& place_m, const Eigen::Vector3d& normal,
                                int16_t light_entry, const Eigen::Vector3d& lit_at_m) const {
  ScanGeometry geometry = MakeScanGeometry(rig_, measurement);
  geometry.table_height_m = table_height_m;
  geometry.part_offset_m = lit_at_m - geometry.part_rotation * (place_m - part_centre_m_);
  PointLimits limits =
      AdmissibleDepth(rig_, measurement.camera_distance_m, sampling_.max_pixel_footprint_m,
                      sampling_.max_circle_of_confusion_px);
  if (sampling_.max_depth_per_pixel_m) {
    limits.max_depth_times_distance_m2 =
        MaxDepthTimesDistance(rig_.camera, measurement, *sampling_.max_depth_per_pixel_m);
  }
  if (sampling_.max_incidence_rad) {
    limits.min_cos_incidence = std::max(0.0, std::cos(*sampling_.max_incidence_rad));
  }
  const ScanInPart scan = MakeScanInPart(rig_, part_centre_m_, geometry, limits);
  if (!scan.sweeps) return false;
  const Eigen::Vector3d from_camera = place_m - scan.camera.origin_m,
                        from_laser = place_m - scan.laser.origin_m;
  if (normal.dot(from_camera) >= 0 || normal.dot(from_laser) >= 0) return false;
  if (!WithinIncidence(limits, normal, -from_camera) ||
      !WithinIncidence(limits, normal, -from_laser)) {
    return false;
  }
  const double depth_m = DepthOf(scan, from_camera);
  if (depth_m < kNearPlaneM || !WithinDepth(limits, depth_m) ||
      !FineInDepth(limits, from_camera, depth_m) || !InRows(scan, from_camera, depth_m) ||
      !InColumns(scan, from_camera, depth_m) || !InRange(scan, from_camera) ||
      !InFan(scan, from_laser)) {
    return false;
  }
  if (light_ != nullptr && light_->At(light_entry, normal, -from_camera, -from_laser).verdict !=
                               LightVerdict::kDetected) {
    return false;
  }
  const Eigen::Vector3f place = place_m.cast<float>(), camera = scan.camera.origin_m.cast<float>(),
                        laser = scan.laser.origin_m.cast<float>();
  for (const Occluder& occluder : occluders_) {
    if (occluder.frame == ObstacleFrame::kWorld) continue;
    const FrameChange change = FromPart(occluder.frame, geometry, part_centre_m_, 0);
    if (Hides(occluder, change, camera, place) || Hides(occluder, change, laser, place)) {
      return false;
    }
  }
  return !SensorBodiesCollide(rig_, geometry) && (table_ == nullptr || !TouchesTable(geometry));
}

}  // namespace sightline
