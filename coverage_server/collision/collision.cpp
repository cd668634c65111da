// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/collision/collision.h"

#include "core/rig/sensor_bodies.h"

namespace sightline {
namespace {

// True if an obstacle that travels with the part, in world axes, cuts into the part.
bool CutsIntoPart(const ScanGeometry& geometry, const Eigen::Vector3d& part_centre_m,
                  const TriangleBvh& part, const Occluder& carrier) {
  // No point of the part is below its support.
  const bool on_table = carrier.frame == ObstacleFrame::kTable;
  if (on_table && carrier.bvh.bounds().max().z() <= 0) return false;
  // The part is shrunk by this fraction about its centre, so that mere contact does not count.
  constexpr double kContact = 0.002;
  const Eigen::Matrix3d to_part = geometry.part_rotation.transpose() / (1 - kContact);
  const Eigen::Vector3d lift(0, 0, on_table ? geometry.table_height_m : 0);
  return part.Touches(carrier.bvh, to_part, part_centre_m + to_part * lift,
                      Eigen::Vector3d::Zero());
}

// Volume that a solid at rest sweeps in the frame of the moving stage.
Zonotope Swept(Zonotope solid, double stage_start_m, double stage_end_m) {
  solid.centre_m.x() -= 0.5 * (stage_start_m + stage_end_m);
  solid.generators_m.push_back(Eigen::Vector3d(0.5 * (stage_end_m - stage_start_m), 0, 0));
  return solid;
}

}  // namespace

bool Collides(const Rig& rig, const ScanGeometry& geometry, const Eigen::Vector3d& part_centre_m,
              const std::vector<Occluder>& occluders, double stage_start_m, double stage_end_m) {
  if (SensorBodiesCollide(rig, geometry)) return true;
  const auto body_hits = [&](const Body& body, const SensorPose& pose) {
    const Zonotope still = BodyAt(WithMargin(body, rig.clearance_m), pose);
    for (const Occluder& occluder : occluders) {
      Zonotope solid = still;
      if (occluder.frame != ObstacleFrame::kWorld) {
        solid = Swept(std::move(solid), stage_start_m, stage_end_m);
        solid.centre_m -= geometry.part_offset_m;
      }
      if (occluder.frame == ObstacleFrame::kTable) solid.centre_m.z() -= geometry.table_height_m;
      if (occluder.frame == ObstacleFrame::kPart) {
        solid.centre_m = geometry.part_rotation.transpose() * solid.centre_m + part_centre_m;
        for (auto& g : solid.generators_m) g = geometry.part_rotation.transpose() * g;
      }
      if (occluder.bvh.Overlaps(solid)) return true;
    }
    return false;
  };
  for (const Body& body : rig.camera_bodies) {
    if (body_hits(body, geometry.camera)) return true;
  }
  for (const Body& body : rig.laser_bodies) {
    if (body_hits(body, geometry.laser)) return true;
  }
  for (const Occluder& carrier : occluders) {
    if (carrier.frame != ObstacleFrame::kStage && carrier.frame != ObstacleFrame::kTable) continue;
    if (occluders[0].frame != ObstacleFrame::kPart) break;
    if (CutsIntoPart(geometry, part_centre_m, occluders[0].bvh, carrier)) return true;
  }
  // Obstacles that stand still, seen from the moving part.
  const Eigen::Matrix3d to_part = geometry.part_rotation.transpose();
  const Eigen::Vector3d middle =
      geometry.part_offset_m + Eigen::Vector3d(0.5 * (stage_start_m + stage_end_m), 0, 0);
  const Eigen::Vector3d half_sweep =
      to_part * Eigen::Vector3d(0.5 * (stage_end_m - stage_start_m), 0, 0);
  for (const Occluder& still : occluders) {
    if (still.frame != ObstacleFrame::kWorld) continue;
    for (const Occluder& moving : occluders) {
      if (moving.frame != ObstacleFrame::kPart) continue;
      if (moving.bvh.Touches(still.bvh, to_part, part_centre_m - to_part * middle, half_sweep)) {
        return true;
      }
    }
  }
  return false;
}

}  // namespace sightline
