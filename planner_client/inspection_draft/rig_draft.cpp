// SPDX-License-Identifier: Apache-2.0
#include "planner_client/inspection_draft/rig_draft.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Largest polar angle of a rigid head's camera; beyond it the head would be next to the table.
constexpr double kMostPolar_deg = 75;
constexpr double kFinestAngle_deg = 1, kFinestDistance_m = 1e-3;

// Avoids a negative zero.
double RoundTo(double value, double per_unit) {
  return std::round(value * per_unit) / per_unit + 0.0;
}

void SetRange(double min, double max, v1::ParameterDomain* parameter) {
  parameter->clear_ranges();
  v1::ParameterDomain::Range& range = *parameter->add_ranges();
  range.set_min(min);
  range.set_max(max);
}

// From `first` to `last`, both included where the step meets them.
void SetSteps(double first, double last, double step, v1::ParameterDomain* parameter) {
  const auto count = static_cast<int>(std::floor((last - first) / step + 1e-9));
  for (int i = 0; i <= count; ++i) parameter->add_values(RoundTo(first + i * step, 1e9));
}

void SetValues(const std::set<double>& values, v1::ParameterDomain* parameter) {
  if (values.size() == 1) {
    parameter->set_fixed(*values.begin());
    return;
  }
  for (const double value : values) parameter->add_values(value);
}

absl::Status CheckWish(const RigWish& wish) {
  const bool housing = wish.kind == RigKind::kRigid || wish.kind == RigKind::kRobot;
  if (housing && wish.triangulation_angles_deg.empty()) {
    return absl::InvalidArgumentError(
        "--triangulation-angle-deg is missing: the angle between camera and laser in their "
        "housing");
  }
  if (housing && wish.stand_offs_m.empty()) {
    return absl::InvalidArgumentError(
        "--stand-off-mm is missing: the distance of the housing from the middle of its range");
  }
  if (!housing && !(wish.triangulation_angles_deg.empty() && wish.stand_offs_m.empty())) {
    return absl::InvalidArgumentError(
        "--triangulation-angle-deg and --stand-off-mm are for --rig rigid and --rig robot");
  }
  if (wish.kind == RigKind::kRobot &&
      (wish.triangulation_angles_deg.size() > 1 || wish.stand_offs_m.size() > 1)) {
    return absl::InvalidArgumentError(
        "--rig robot takes one --triangulation-angle-deg and one --stand-off-mm");
  }
  const bool moved = wish.kind == RigKind::kTurntable || wish.kind == RigKind::kRobot;
  for (const auto& [option, value] :
       {std::pair("--urdf", &wish.urdf), std::pair("--tip-link", &wish.tip_link)}) {
    if (moved && value->empty()) {
      return absl::InvalidArgumentError(absl::StrCat(option,
                                                     " is missing: --rig turntable and "
                                                     "--rig robot need the URDF file and "
                                                     "its link that holds part or head"));
    }
    if (!moved && !value->empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat(option, " is for --rig turntable and --rig robot"));
    }
  }
  if (wish.angle_step_deg && *wish.angle_step_deg < kFinestAngle_deg) {
    return absl::InvalidArgumentError("--angle-step-deg must be at least 1");
  }
  if (wish.distance_step_m && *wish.distance_step_m < kFinestDistance_m) {
    return absl::InvalidArgumentError("--distance-step-mm must be at least 1");
  }
  return absl::OkStatus();
}

// Distance and triangulation angle of the housing.
void DraftHousing(const RigWish& wish, v1::Inspection* inspection) {
  std::set<double> angles_deg, distances_m;
  for (const double angle_deg : wish.triangulation_angles_deg) {
    angles_deg.insert(angle_deg);
    for (const double stand_off_m : wish.stand_offs_m) {
      distances_m.insert(RoundTo(stand_off_m / std::cos(angle_deg * std::numbers::pi / 180), 1e6));
    }
  }
  v1::MeasurementDomain& domain = *inspection->mutable_measurement();
  SetValues(distances_m, domain.mutable_camera_distance_m());
  SetValues(angles_deg, domain.mutable_triangulation_angle_deg());
  if (wish.stand_offs_m.size() == 1) {
    inspection->mutable_laser()->set_distance_m(wish.stand_offs_m.front());
  }
}

void DraftSteps(const RigWish& wish, v1::MeasurementDomain* domain) {
  if (wish.angle_step_deg) {
    const double step_deg = *wish.angle_step_deg;
    if (!domain->has_triangulation_angle_deg()) {
      v1::ParameterDomain& angle = *domain->mutable_triangulation_angle_deg();
      const double first_deg = std::ceil(10 / step_deg) * step_deg;
      SetSteps(-std::floor(80 / step_deg) * step_deg, -first_deg, step_deg, &angle);
      SetSteps(first_deg, 80, step_deg, &angle);
    }
    if (!domain->has_camera_azimuth_deg()) {
      SetSteps(0, 360 - step_deg, step_deg, domain->mutable_camera_azimuth_deg());
    }
    domain->clear_camera_polar_deg();
    SetSteps(0, wish.kind == RigKind::kFree ? 90 : kMostPolar_deg, step_deg,
             domain->mutable_camera_polar_deg());
    SetSteps(0, 360 - step_deg, step_deg, domain->mutable_part_gamma_deg());
  }
  if (wish.distance_step_m && !domain->has_camera_distance_m()) {
    SetSteps(std::ceil(0.1 / *wish.distance_step_m - 1e-9) * *wish.distance_step_m, 0.8,
             *wish.distance_step_m, domain->mutable_camera_distance_m());
  }
}

// A table of a URDF file under the part: its axis through the part's centre, its upper face below
// it.
void DraftTurntable(const RigWish& wish, const PartHealth& health, v1::Inspection* inspection) {
  v1::Rig& rig = *inspection->mutable_rig();
  rig.set_part_holding(v1::Rig::PART_HOLDING_FREE);
  v1::Robot& robot = *rig.mutable_robot();
  robot.set_urdf(wish.urdf);
  robot.set_tip_link(wish.tip_link);
  robot.set_load(v1::Robot::LOAD_PART);
  const Eigen::Vector3d centre_m = health.bounding_box_m.center();
  robot.mutable_base_position_m()->set_z(RoundTo(-0.5 * health.bounding_box_m.sizes().z(), 1e6));
  robot.mutable_load_position_m()->set_x(RoundTo(-centre_m.x(), 1e6));
  robot.mutable_load_position_m()->set_y(RoundTo(-centre_m.y(), 1e6));
  robot.mutable_load_position_m()->set_z(RoundTo(-health.bounding_box_m.min().z(), 1e6));
  v1::MeasurementDomain& domain = *inspection->mutable_measurement();
  SetRange(0, kMostPolar_deg, domain.mutable_camera_polar_deg());
  domain.mutable_part_alpha_deg()->set_fixed(0);
  domain.mutable_part_beta_deg()->set_fixed(0);
  domain.clear_offset_y_m();
  domain.clear_offset_z_m();
  domain.mutable_offset_y_m()->set_fixed(0);
  domain.mutable_offset_z_m()->set_fixed(0);
}

void DraftRobot(const RigWish& wish, v1::Inspection* inspection) {
  v1::Robot& robot = *inspection->mutable_rig()->mutable_robot();
  robot.set_urdf(wish.urdf);
  robot.set_tip_link(wish.tip_link);
  robot.set_load(v1::Robot::LOAD_SENSOR_HEAD);
  robot.mutable_base_position_m()->set_y(-0.7);
  robot.mutable_load_position_m()->set_z(0.15);
  v1::MeasurementDomain& domain = *inspection->mutable_measurement();
  SetRange(0, 60, domain.mutable_camera_polar_deg());
  if (!wish.angle_step_deg) SetSteps(0, 270, 90, domain.mutable_part_gamma_deg());
}

}  // namespace

std::optional<RigKind> RigKindNamed(const std::string& name) {
  if (name == "free") return RigKind::kFree;
  if (name == "rigid") return RigKind::kRigid;
  if (name == "turntable") return RigKind::kTurntable;
  if (name == "robot") return RigKind::kRobot;
  return std::nullopt;
}

absl::Status DraftRig(const RigWish& wish, const PartHealth& health, v1::Inspection* inspection,
                      FieldComments* comments) {
  SIGHTLINE_RETURN_IF_ERROR(CheckWish(wish));
  v1::Rig& rig = *inspection->mutable_rig();
  v1::MeasurementDomain& domain = *inspection->mutable_measurement();
  if (!wish.stage_moves_in_height) {
    rig.set_stage_moves_in_height(false);
    (*comments)["rig.stage_moves_in_height"] =
        "The height of the part below the sensors is set at the sensors.";
  }
  switch (wish.kind) {
    case RigKind::kFree:
      break;
    case RigKind::kRigid:
      rig.set_sensor_mount(v1::Rig::SENSOR_MOUNT_RIGID);
      (*comments)["rig.sensor_mount"] =
          "Camera and laser in one housing, moved as one without a calibration.";
      DraftHousing(wish, inspection);
      // On a portal: the laser line across the travel, the camera before or behind it.
      if (!wish.angle_step_deg) {
        domain.mutable_camera_azimuth_deg()->add_values(0);
        domain.mutable_camera_azimuth_deg()->add_values(180);
      }
      SetRange(0, kMostPolar_deg, domain.mutable_camera_polar_deg());
      break;
    case RigKind::kTurntable:
      DraftTurntable(wish, health, inspection);
      (*comments)["rig.robot"] =
          "A stage with a turntable that holds the part. Put in where its URDF's base stands in "
          "the "
          "world, and where the part stands on tip_link.";
      break;
    case RigKind::kRobot:
      DraftHousing(wish, inspection);
      DraftRobot(wish, inspection);
      (*comments)["rig.robot"] =
          "An arm that holds camera and laser. Put in where its base stands (on the table, the "
          "stage at 0) and where the camera is on tip_link.";
      break;
  }
  DraftSteps(wish, &domain);
  if (inspection->measurement().ByteSizeLong() == 0) inspection->clear_measurement();
  return absl::OkStatus();
}

}  // namespace sightline
