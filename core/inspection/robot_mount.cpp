// SPDX-License-Identifier: Apache-2.0
#include "core/inspection/robot_mount.h"

#include "absl/strings/str_cat.h"
#include "core/field_limits/field_checks.h"
#include "core/inspection/inspection.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr Limits kMountPosition{-100, 100, " m"};
constexpr Limits kAngle{-360, 360, " deg"};
constexpr Limits kSpeedFraction{0, 1, "", true};
constexpr Limits kAccelerationTime{0, 60, " s"};
// The limits exceed one turn of any drive and the length of any linear axis in metres.
constexpr Limits kJointPosition{-1000, 1000, " rad or m"};
constexpr int kMostJoints = 16;

absl::StatusOr<Eigen::Isometry3d> ParsePose(const v1::Vector3& position_m,
                                            const v1::Vector3& angles_deg, const std::string& name,
                                            const Checker& check) {
  for (const double value : {position_m.x(), position_m.y(), position_m.z()}) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat("rig.robot.", name, "_position_m"), value, kMountPosition));
  }
  for (const double value : {angles_deg.x(), angles_deg.y(), angles_deg.z()}) {
    SIGHTLINE_RETURN_IF_ERROR(
        check.Range(absl::StrCat("rig.robot.", name, "_roll_pitch_yaw_deg"), value, kAngle));
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = (Eigen::AngleAxisd(Radians(angles_deg.z()), Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(Radians(angles_deg.y()), Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(Radians(angles_deg.x()), Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  pose.translation() = Eigen::Vector3d(position_m.x(), position_m.y(), position_m.z());
  return pose;
}

bool IsOneValue(const ParameterDomain& domain) {
  return (domain.ranges.empty() && domain.values.size() == 1) ||
         (domain.ranges.size() == 1 && domain.ranges[0].min == domain.ranges[0].max);
}

absl::Status CheckHead(const v1::Inspection& message, const MeasurementDomain& domain,
                       const Checker& check) {
  const char* names[] = {"measurement.camera_distance_m", "measurement.triangulation_angle_deg"};
  for (int p = 0; p < 2; ++p) {
    if (IsOneValue(domain.parameters[p])) continue;
    return check.Error(names[p],
                       "must be fixed to one value: rig.robot carries camera and laser, which are "
                       "rigid to each other");
  }
  for (int i = 0; i < message.obstacles_size(); ++i) {
    if (message.obstacles(i).frame() != v1::Obstacle::FRAME_WORLD) continue;
    return check.Error(absl::StrCat("obstacles[", i, "].frame"),
                       "is FRAME_WORLD, which moves with sensors that a robot carries; what stands "
                       "still beside the robot is to be links of its URDF");
  }
  return absl::OkStatus();
}

absl::Status CheckCarriedPart(const v1::Inspection& message, const Checker& check) {
  const v1::Rig::PartHolding holding = message.rig().part_holding();
  if (holding != v1::Rig::PART_HOLDING_FIXTURE && holding != v1::Rig::PART_HOLDING_FREE) {
    return check.Error("rig.part_holding",
                       "must be PART_HOLDING_FREE or PART_HOLDING_FIXTURE: rig.robot carries the "
                       "part, so that it does not rest on a table");
  }
  for (int i = 0; i < message.obstacles_size(); ++i) {
    const v1::Obstacle::Frame frame = message.obstacles(i).frame();
    if (frame == v1::Obstacle::FRAME_PART || frame == v1::Obstacle::FRAME_WORLD) continue;
    return check.Error(absl::StrCat("obstacles[", i, "].frame"),
                       "must be FRAME_PART or FRAME_WORLD: rig.robot carries the part, so that "
                       "nothing travels with a stage");
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RobotMount> ParseRobotMount(const v1::Inspection& message,
                                           const MeasurementDomain& domain,
                                           const std::string& context) {
  const Checker check(context);
  const v1::Robot& robot = message.rig().robot();
  RobotMount mount;
  if (robot.urdf().empty()) return check.Error("rig.robot.urdf", "is missing");
  mount.urdf_file = robot.urdf();
  mount.base_link = robot.base_link();
  if (robot.tip_link().empty()) return check.Error("rig.robot.tip_link", "is missing");
  mount.tip_link = robot.tip_link();
  switch (robot.load()) {
    case v1::Robot::LOAD_SENSOR_HEAD:
      mount.load = RobotMount::Load::kSensorHead;
      SIGHTLINE_RETURN_IF_ERROR(CheckHead(message, domain, check));
      break;
    case v1::Robot::LOAD_PART:
      mount.load = RobotMount::Load::kPart;
      SIGHTLINE_RETURN_IF_ERROR(CheckCarriedPart(message, check));
      break;
    default:
      return check.Error("rig.robot.load", "is missing, must be LOAD_SENSOR_HEAD or LOAD_PART");
  }
  SIGHTLINE_ASSIGN_OR_RETURN(mount.base, ParsePose(robot.base_position_m(),
                                                   robot.base_roll_pitch_yaw_deg(), "base", check));
  SIGHTLINE_ASSIGN_OR_RETURN(
      mount.load_on_tip,
      ParsePose(robot.load_position_m(), robot.load_roll_pitch_yaw_deg(), "load", check));
  if (robot.home_position_size() > kMostJoints) {
    return check.Error("rig.robot.home_position", absl::StrCat("has ", robot.home_position_size(),
                                                               " entries, at most ", kMostJoints));
  }
  for (int i = 0; i < robot.home_position_size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(check.Range(absl::StrCat("rig.robot.home_position[", i, "]"),
                                          robot.home_position(i), kJointPosition));
    mount.home.push_back(robot.home_position(i));
  }
  if (robot.has_speed_fraction()) mount.speed_fraction = robot.speed_fraction();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("rig.robot.speed_fraction", mount.speed_fraction, kSpeedFraction));
  mount.acceleration_time_s = robot.acceleration_time_s();
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("rig.robot.acceleration_time_s", mount.acceleration_time_s, kAccelerationTime));
  return mount;
}

}  // namespace sightline
