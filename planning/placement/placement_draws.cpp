// SPDX-License-Identifier: Apache-2.0
#include "planning/placement/placement_draws.h"

#include <Eigen/Core>
#include <cmath>
#include <utility>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

Eigen::Vector3d NormalVector(CounterRandom& random, double standard_deviation) {
  // Separate statements fix the order of evaluation; constructor arguments have none.
  const double x = random.Normal(), y = random.Normal(), z = random.Normal();
  return standard_deviation * Eigen::Vector3d(x, y, z);
}

}  // namespace

PlacementModel PlacementModelOf(const Inspection& inspection) {
  PlacementModel model;
  model.errors = inspection.placement;
  model.rig = inspection.rig;
  model.execution = ExecutionModelOf(inspection);
  model.rigid_head =
      inspection.sensor_mount == SensorMount::kRigid || model.execution.robot_holds_head;
  model.on_table =
      inspection.part_holding == PartHolding::kResting && !model.execution.robot_holds_part;
  return model;
}

PlacementDraws::PlacementDraws(PlacementModel model, std::span<const Measurement> scans)
    : model_(std::move(model)), placings_(PlacingsOf(model_.execution, scans)) {
  for (size_t i = 0; i < scans.size(); ++i) {
    geometries_.push_back(MakeScanGeometry(model_.rig, scans[i]));
    const bool stays = i > 0 && (placings_[i].sensors == placings_[i - 1].sensors ||
                                 placings_[i].part == placings_[i - 1].part);
    if (stays) {
      group_ends_.back() = i + 1;
    } else {
      group_ends_.push_back(i + 1);
    }
  }
}

std::vector<ScanDisplacement> PlacementDraws::Draw(uint64_t seed, uint32_t execution) const {
  const PlacementErrors& errors = model_.errors;
  std::vector<ScanDisplacement> displacements;
  for (size_t i = 0; i < geometries_.size(); ++i) {
    CounterRandom sensors(DeriveSeed(seed, "sensors"), placings_[i].sensors, execution);
    CounterRandom part(DeriveSeed(seed, "part"), placings_[i].part, execution);
    const auto draw = [](CounterRandom& random, double position_m, double angle_rad) {
      Displacement displacement;
      displacement.rotation_rad = NormalVector(random, angle_rad);
      displacement.translation_m = NormalVector(random, position_m);
      return displacement;
    };
    ScanDisplacement& displacement = displacements.emplace_back();
    displacement.part = draw(part, errors.part_position_m, errors.part_angle_rad);
    if (model_.on_table) displacement.part.rotation_rad.head<2>().setZero();
    displacement.camera = draw(sensors, errors.sensor_position_m, errors.sensor_angle_rad);
    if (!model_.rigid_head) {
      displacement.laser = draw(sensors, errors.sensor_position_m, errors.sensor_angle_rad);
      continue;
    }
    // The laser turns about the camera's pupil.
    const Eigen::Vector3d arm_m = geometries_[i].laser.origin_m - geometries_[i].camera.origin_m;
    displacement.laser = displacement.camera;
    displacement.laser.translation_m += displacement.camera.Rotation() * arm_m - arm_m;
  }
  return displacements;
}

}  // namespace sightline
