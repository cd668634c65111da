// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/robot_cell.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr int kMostSteps = 5000;
// Largest turn of a joint between two steps of 10 mm on a straight line; a larger one indicates a
// singularity.
constexpr double kLargestTurnRad = 0.5;

double Degrees(double rad) { return rad * 180 / std::numbers::pi; }

Eigen::Isometry3d ToIsometry(const SensorPose& pose) { return Eigen::Isometry3d(pose.Matrix()); }

Eigen::Isometry3d PartInWorld(const ScanGeometry& geometry, const Eigen::Vector3d& centre_m,
                              double stage_m) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = geometry.part_rotation;
  pose.translation() = geometry.part_offset_m + stage_m * Eigen::Vector3d::UnitX() -
                       geometry.part_rotation * centre_m;
  return pose;
}

std::string ContactText(const Contact& contact) {
  return absl::StrCat("collision: ", contact.first, " with ", contact.second);
}

// Vertices that contain the lowest one in any orientation. For large meshes: the lowest vertex
// along each of many directions 0.06 rad apart; other vertices are lower by less than 0.0005 of the
// size.
std::vector<Eigen::Vector3f> ExtremeVertices(const TriangleMesh& mesh) {
  constexpr size_t kAll = 20000;
  if (mesh.positions_m.size() <= kAll) return mesh.positions_m;
  constexpr int kDirections = 4000;  // of a Fibonacci lattice
  std::vector<Eigen::Vector3f> result;
  for (int i = 0; i < kDirections; ++i) {
    const double z = 1 - (2.0 * i + 1) / kDirections;
    const double angle = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3f direction(static_cast<float>(r * std::cos(angle)),
                                    static_cast<float>(r * std::sin(angle)), static_cast<float>(z));
    const auto lowest = std::min_element(
        mesh.positions_m.begin(), mesh.positions_m.end(),
        [&](const auto& a, const auto& b) { return a.dot(direction) < b.dot(direction); });
    result.push_back(*lowest);
  }
  return result;
}

}  // namespace

RobotCell::RobotCell(CellTask task, RobotModel model)
    : task_(std::move(task)),
      model_(std::move(model)),
      kinematics_(model_),
      to_base_(task_.mount.base.inverse()) {
  std::vector<LoadSolid> load;
  part_ = CollisionSolid::FromMesh(*task_.part);
  for (const CellObstacle& obstacle : task_.obstacles) {
    obstacles_.push_back(CollisionSolid::FromMesh(*obstacle.mesh));
  }
  const Eigen::Isometry3d& on_tip = task_.mount.load_on_tip;
  if (carries_part()) {
    load.push_back({"part", *part_, *part_, on_tip});
    for (size_t i = 0; i < obstacles_.size(); ++i) {
      if (task_.obstacles[i].frame != ObstacleFrame::kPart) continue;
      load.push_back({task_.obstacles[i].name, obstacles_[i], obstacles_[i], on_tip});
    }
    for (const Body& body : task_.rig.camera_bodies) {
      camera_.push_back(CollisionSolid::FromBody(body, 0));
    }
    for (const Body& body : task_.rig.laser_bodies) {
      laser_.push_back(CollisionSolid::FromBody(body, 0));
    }
  } else {
    const ScanGeometry geometry = MakeScanGeometry(task_.rig, task_.head);
    const Eigen::Isometry3d laser =
        ToIsometry(geometry.camera).inverse() * ToIsometry(geometry.laser);
    const auto add = [&](const std::vector<Body>& bodies, const char* name,
                         const Eigen::Isometry3d& pose) {
      for (const Body& body : bodies) {
        load.push_back({name, CollisionSolid::FromBody(body, 0),
                        CollisionSolid::FromBody(body, kClearanceM), on_tip * pose});
      }
    };
    add(task_.rig.camera_bodies, "camera", Eigen::Isometry3d::Identity());
    add(task_.rig.laser_bodies, "laser", laser);
    lowest_ = ExtremeVertices(*task_.part);
  }
  collision_.emplace(model_, std::move(load));
}

absl::StatusOr<std::unique_ptr<RobotCell>> RobotCell::Make(CellTask task) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto model, ReadRobotModel(task.mount));
  std::unique_ptr<RobotCell> cell(new RobotCell(std::move(task), std::move(model)));
  if (const auto contact =
          cell->collision_->WithItself(cell->model_.LinkPoses(cell->model_.home))) {
    return absl::InvalidArgumentError(absl::StrCat(
        "rig.robot.home_position: there ", contact->first, " touches ", contact->second,
        cell->task_.mount.home.empty()
            ? "; without home_position it is the middle of the joints' ranges"
            : ""));
  }
  return cell;
}

double RobotCell::HeightOverTable(const Eigen::Matrix3d& part_rotation) const {
  const Eigen::Vector3d down = part_rotation.row(2);
  double lowest_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3f& p : lowest_) {
    lowest_m = std::min(lowest_m, down.dot(p.cast<double>() - task_.part_centre_m));
  }
  return -lowest_m;
}

Eigen::Isometry3d RobotCell::TipGoal(const ScanGeometry& geometry, double height_m,
                                     double stage_m) const {
  Eigen::Isometry3d load;
  if (carries_part()) {
    load = PartInWorld(geometry, task_.part_centre_m, stage_m);
  } else {
    load = ToIsometry(geometry.camera);
    load.pretranslate(
        Eigen::Vector3d(height_m * Eigen::Vector3d::UnitZ() - geometry.part_offset_m));
  }
  return to_base_ * load * task_.mount.load_on_tip.inverse();
}

std::vector<NamedSolid> RobotCell::Around(const ScanGeometry& geometry, double height_m,
                                          double stage_m) const {
  std::vector<NamedSolid> around;
  if (carries_part()) {
    const Eigen::Isometry3d camera = to_base_ * ToIsometry(geometry.camera);
    const Eigen::Isometry3d laser = to_base_ * ToIsometry(geometry.laser);
    for (const CollisionSolid& solid : camera_) around.push_back({"camera", solid, camera});
    for (const CollisionSolid& solid : laser_) around.push_back({"laser", solid, laser});
    for (size_t i = 0; i < obstacles_.size(); ++i) {
      if (task_.obstacles[i].frame == ObstacleFrame::kPart) continue;
      around.push_back({task_.obstacles[i].name, obstacles_[i], to_base_});
    }
    return around;
  }
  const Eigen::Vector3d stage = stage_m * Eigen::Vector3d::UnitX();
  Eigen::Isometry3d part = PartInWorld(geometry, task_.part_centre_m, stage_m);
  part.pretranslate(Eigen::Vector3d(height_m * Eigen::Vector3d::UnitZ() - geometry.part_offset_m));
  around.push_back({"part", *part_, to_base_ * part});
  for (size_t i = 0; i < obstacles_.size(); ++i) {
    Eigen::Isometry3d pose = part;
    if (task_.obstacles[i].frame != ObstacleFrame::kPart) {
      pose = Eigen::Isometry3d::Identity();
      pose.translation() = stage;
      // The origin of FRAME_TABLE is that of the cell. FRAME_WORLD is rejected if a robot carries a
      // head.
      if (task_.obstacles[i].frame == ObstacleFrame::kStage) pose.translation().z() += height_m;
    }
    around.push_back({task_.obstacles[i].name, obstacles_[i], to_base_ * pose});
  }
  return around;
}

std::vector<NamedSolid> RobotCell::Around(const Measurement& measurement, double stage_m) const {
  const ScanGeometry geometry = MakeScanGeometry(task_.rig, measurement);
  return Around(geometry, carries_part() ? 0 : HeightOverTable(geometry.part_rotation), stage_m);
}

std::string RobotCell::LimitText(int joint, double position) const {
  const RobotJoint& j = model_.joints[static_cast<size_t>(joint)];
  const double scale = j.rotary ? Degrees(1) : 1e3;
  return absl::StrFormat("joint limit: %s would be at %.1f %s, its limits are %.1f to %.1f", j.name,
                         scale * position, j.rotary ? "deg" : "mm", scale * j.min, scale * j.max);
}

std::string RobotCell::MissText(const InverseKinematicsResult& result) const {
  if (result.miss == InverseKinematicsResult::Miss::kLimit) {
    return LimitText(result.limit_joint, result.limit_position);
  }
  return absl::StrFormat("outside reach: the tip stays %.0f mm and %.1f deg away",
                         1e3 * result.miss_m, Degrees(result.miss_rad));
}

Reach RobotCell::HeadReach(const ScanGeometry& geometry, double height_m, const ScanTravel& travel,
                           bool every) const {
  Reach reach;
  const std::vector<NamedSolid> around = Around(geometry, height_m, 0);
  const Eigen::Vector3d along = to_base_.linear().col(0);
  const auto result =
      kinematics_.Solve(TipGoal(geometry, height_m, 0), [&](const JointPositions& q) {
        const auto links = model_.LinkPoses(q);
        std::optional<Contact> contact = collision_->WithItself(links);
        // The coverage server checks the bodies of the head.
        if (!contact) {
          contact = collision_->WithMovingSurroundings(links, around, travel.start_m * along,
                                                       travel.end_m * along, false);
        }
        if (contact) {
          if (reach.because.empty()) reach.because = ContactText(*contact);
          return false;
        }
        reach.positions.push_back({q, q});
        return !every;
      });
  if (result.solutions.empty()) reach.because = MissText(result);
  return reach;
}

std::string RobotCell::Follow(const ScanGeometry& geometry, const ScanTravel& travel,
                              std::span<const NamedSolid> around, const JointPositions& start,
                              JointPositions* end) const {
  const double length_m = travel.end_m - travel.start_m;
  const int steps =
      std::clamp(static_cast<int>(std::ceil(length_m / (2 * kClearanceM))), 1, kMostSteps);
  *end = start;
  for (int k = 0; k <= steps; ++k) {
    const double stage_m = travel.start_m + length_m * k / steps;
    const auto at = [&](const std::string& what) {
      return absl::StrFormat("%s, with the stage at %.0f mm", what, 1e3 * stage_m);
    };
    if (k > 0) {
      bool reached = false;
      const JointPositions before = *end;
      *end = kinematics_.Follow(TipGoal(geometry, 0, stage_m), before, &reached);
      if (!reached) return at("outside reach: the arm cannot follow the travel");
      for (size_t j = 0; j < end->size(); ++j) {
        const RobotJoint& joint = model_.joints[j];
        if (joint.rotary && std::abs((*end)[j] - before[j]) > kLargestTurnRad) {
          return at(absl::StrCat("singularity: joint ", joint.name, " would have to jump"));
        }
        if (!joint.continuous && ((*end)[j] < joint.min || (*end)[j] > joint.max)) {
          return at(LimitText(static_cast<int>(j), (*end)[j]));
        }
      }
    }
    const auto links = model_.LinkPoses(*end);
    std::optional<Contact> contact = collision_->WithItself(links);
    if (!contact) contact = collision_->WithSurroundings(links, around, false);
    if (contact) return at(ContactText(*contact));
  }
  return "";
}

Reach RobotCell::PartReach(const ScanGeometry& geometry, const ScanTravel& travel,
                           bool every) const {
  Reach reach;
  const std::vector<NamedSolid> around = Around(geometry, 0, 0);
  const auto result =
      kinematics_.Solve(TipGoal(geometry, 0, travel.start_m), [&](const JointPositions& q) {
        JointPositions end;
        const std::string why = Follow(geometry, travel, around, q, &end);
        if (!why.empty()) {
          if (reach.because.empty()) reach.because = why;
          return false;
        }
        reach.positions.push_back({q, end});
        return !every;
      });
  if (result.solutions.empty()) reach.because = MissText(result);
  return reach;
}

Reach RobotCell::Reachable(const Measurement& measurement, const ScanTravel& travel,
                           bool every) const {
  const ScanGeometry geometry = MakeScanGeometry(task_.rig, measurement);
  Reach reach = carries_part()
                    ? PartReach(geometry, travel, every)
                    : HeadReach(geometry, HeightOverTable(geometry.part_rotation), travel, every);
  if (reach.reachable()) reach.because.clear();
  return reach;
}

std::vector<Eigen::Isometry3d> RobotCell::LinksInPart(const Measurement& measurement,
                                                      double stage_m,
                                                      const JointPositions& q) const {
  const ScanGeometry geometry = MakeScanGeometry(task_.rig, measurement);
  Eigen::Isometry3d part = PartInWorld(geometry, task_.part_centre_m, stage_m);
  if (!carries_part()) {
    const double height_m = HeightOverTable(geometry.part_rotation);
    part.pretranslate(
        Eigen::Vector3d(height_m * Eigen::Vector3d::UnitZ() - geometry.part_offset_m));
  }
  std::vector<Eigen::Isometry3d> links = model_.LinkPoses(q);
  for (Eigen::Isometry3d& link : links) link = part.inverse() * task_.mount.base * link;
  return links;
}

std::optional<Contact> RobotCell::OnTheWay(const JointPositions& from, const JointPositions& to,
                                           std::span<const NamedSolid> around) const {
  const double farthest_m = collision_->FarthestMotion(from, to);
  const int steps =
      std::clamp(static_cast<int>(std::ceil(farthest_m / (2 * kClearanceM))), 1, kMostSteps);
  JointPositions q(from.size());
  for (int k = 0; k <= steps; ++k) {
    for (size_t j = 0; j < q.size(); ++j) q[j] = from[j] + (to[j] - from[j]) * k / steps;
    const auto links = model_.LinkPoses(q);
    std::optional<Contact> contact = collision_->WithItself(links);
    if (!contact) contact = collision_->WithSurroundings(links, around, true);
    if (contact) return contact;
  }
  return std::nullopt;
}

double RobotCell::MoveTimeS(const JointPositions& from, const JointPositions& to) const {
  double at_speed_s = 0;
  for (size_t j = 0; j < from.size(); ++j) {
    at_speed_s = std::max(at_speed_s, std::abs(to[j] - from[j]) / (model_.joints[j].max_speed *
                                                                   task_.mount.speed_fraction));
  }
  // Starting and stopping each add half of the ramp time; a short move never gets to full speed.
  const double ramp_s = task_.mount.acceleration_time_s;
  return at_speed_s >= ramp_s ? at_speed_s + ramp_s : 2 * std::sqrt(at_speed_s * ramp_s);
}

ScanTravel EstimateTravel(const Rig& rig, const TargetSet& targets, double spacing_m,
                          const Eigen::Vector3d& part_centre_m, const Measurement& measurement) {
  constexpr size_t kLookedAt = 1000;
  const ScanGeometry g = MakeScanGeometry(rig, measurement);
  const double tan_v = std::tan(0.5 * rig.camera.vertical_fov_rad);
  const double tan_u = tan_v * rig.camera.columns_px / rig.camera.rows_px;
  const double half_fan = 0.5 * rig.laser.fan_angle_rad;
  const size_t stride = targets.size() / kLookedAt + 1;
  ScanTravel travel{std::numeric_limits<double>::infinity(),
                    -std::numeric_limits<double>::infinity()};
  for (size_t i = 0; i < targets.size(); i += stride) {
    const Eigen::Vector3d at_0 =
        PartToWorld(g, part_centre_m, targets.positions_m[i].cast<double>(), 0);
    const double stage_m = g.LitStagePosition(at_0);
    if (!std::isfinite(stage_m)) continue;
    const Eigen::Vector3d x = at_0 + stage_m * Eigen::Vector3d::UnitX();
    const Eigen::Vector3d normal = g.part_rotation * targets.normals[i].cast<double>();
    const Eigen::Vector3d to_camera = x - g.camera.origin_m, to_laser = x - g.laser.origin_m;
    if (normal.dot(to_camera) >= 0 || normal.dot(to_laser) >= 0) continue;
    const double depth = to_camera.dot(g.camera.z_axis);
    if (!(depth > 0) || to_camera.norm() > rig.max_range_m ||
        std::abs(to_camera.dot(g.camera.x_axis)) > tan_u * depth ||
        std::abs(to_camera.dot(g.camera.y_axis)) > tan_v * depth) {
      continue;
    }
    if (std::abs(std::atan2(to_laser.dot(g.laser.x_axis), to_laser.dot(g.laser.z_axis))) >
        half_fan) {
      continue;
    }
    travel.start_m = std::min(travel.start_m, stage_m);
    travel.end_m = std::max(travel.end_m, stage_m);
  }
  if (!(travel.start_m <= travel.end_m)) return {};
  return {travel.start_m - spacing_m, travel.end_m + spacing_m};
}

}  // namespace sightline
