// SPDX-License-Identifier: Apache-2.0
#include "planner_client/explore/scan_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

nlohmann::json RowMajor(const Eigen::Matrix4d& matrix) {
  nlohmann::json values = nlohmann::json::array();
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) values.push_back(matrix(row, column));
  }
  return values;
}

}  // namespace

StageTravel TravelThroughBox(const Rig& rig, const Eigen::AlignedBox3d& part_box_m,
                             const Measurement& measurement) {
  const ScanGeometry geometry = MakeScanGeometry(rig, measurement);
  StageTravel travel{std::numeric_limits<double>::infinity(),
                     -std::numeric_limits<double>::infinity()};
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d x_part =
        part_box_m.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    const double stage_m =
        geometry.LitStagePosition(PartToWorld(geometry, part_box_m.center(), x_part, 0));
    travel.start_m = std::min(travel.start_m, stage_m);
    travel.end_m = std::max(travel.end_m, stage_m);
  }
  if (!std::isfinite(travel.start_m) || !std::isfinite(travel.end_m)) return {};
  return travel;
}

nlohmann::json ScanView(const Rig& rig, const Eigen::Vector3d& part_centre_m,
                        const Measurement& measurement, const StageTravel& travel) {
  const ScanGeometry geometry = MakeScanGeometry(rig, measurement);
  const auto pose = [&](const SensorPose& sensor) {
    return RowMajor(WorldToPart(geometry, part_centre_m, sensor, travel.start_m).Matrix());
  };
  // The part moves along +x of the world; seen from the part the sensors move the other way.
  const Eigen::Vector3d direction = -geometry.part_rotation.row(0).transpose();
  return {{"camera_pose", pose(geometry.camera)},
          {"laser_pose", pose(geometry.laser)},
          {"sensor_direction", {direction.x(), direction.y(), direction.z()}},
          {"camera_distance_m", measurement.camera_distance_m},
          {"laser_distance_m", rig.laser.distance_m.value_or(measurement.camera_distance_m)},
          {"stage_start_m", travel.start_m},
          {"stage_end_m", travel.end_m}};
}

}  // namespace sightline
