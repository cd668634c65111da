// SPDX-License-Identifier: Apache-2.0
// The cell: an arm, its load and its surroundings, with a check that the arm reaches a scan.
//
// An arm with the sensor head holds one pose during a whole scan, while the part travels on its
// stage. The arm also performs the offsets of the scan, so that the part never leaves the stage. An
// arm or table with the part carries it past fixed sensors along the whole travel.
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/rig/measurement.h"
#include "core/rig/scan_geometry.h"
#include "core/targets/target_set.h"
#include "planning/robot/inverse_kinematics.h"
#include "planning/robot/robot_collision.h"
#include "planning/robot/urdf/robot_model.h"

namespace sightline {

// Stage positions of the first and the last frame.
struct ScanTravel {
  double start_m = 0, end_m = 0;
};

struct CellObstacle {
  std::string name;
  std::shared_ptr<const TriangleMesh> mesh;
  ObstacleFrame frame = ObstacleFrame::kPart;
};

struct CellTask {
  RobotMount mount;
  Rig rig;
  // Sets camera distance and triangulation angle of a rigid head; not used if the arm holds the
  // part.
  Measurement head;
  std::shared_ptr<const TriangleMesh> part;
  Eigen::Vector3d part_centre_m = Eigen::Vector3d::Zero();
  std::vector<CellObstacle> obstacles;
};

// Joint positions at the start and at the end of a scan.
struct ScanPosition {
  JointPositions start, end;
};

struct Reach {
  // Joint positions from which the arm can make the scan; if empty, `because` is the reason.
  std::vector<ScanPosition> positions;
  std::string because;

  bool reachable() const { return !positions.empty(); }
};

class RobotCell {
 public:
  // Errors as ReadRobotModel; INVALID_ARGUMENT also if the arm touches itself at home.
  static absl::StatusOr<std::unique_ptr<RobotCell>> Make(CellTask task);
  RobotCell(const RobotCell&) = delete;
  RobotCell& operator=(const RobotCell&) = delete;

  const RobotModel& model() const { return model_; }
  bool carries_part() const { return task_.mount.load == RobotMount::Load::kPart; }

  // `every`: returns all positions found instead of the first. `travel.start_m` <= `travel.end_m`.
  // Thread-safe.
  Reach Reachable(const Measurement& measurement, const ScanTravel& travel, bool every) const;

  // Poses of all links at a stage position, in part coordinates.
  std::vector<Eigen::Isometry3d> LinksInPart(const Measurement& measurement, double stage_m,
                                             const JointPositions& q) const;

  // The solids around the arm while it moves to or from a scan, with the stage at rest.
  std::vector<NamedSolid> Around(const Measurement& measurement, double stage_m) const;
  // First contact on the straight line between two positions; nothing if it is free. Between
  // two steps no point of the arm moves more than 2 kClearanceM. Lines are limited to 5000
  // steps.
  std::optional<Contact> OnTheWay(const JointPositions& from, const JointPositions& to,
                                  std::span<const NamedSolid> around) const;
  // Time of the slowest joint at the mount's fraction of its speed, from rest to rest with constant
  // acceleration [s].
  double MoveTimeS(const JointPositions& from, const JointPositions& to) const;

 private:
  RobotCell(CellTask task, RobotModel model);

  // Pose of the load in the frame of the base link, from its pose in the cell (parts: in the
  // world).
  Eigen::Isometry3d TipGoal(const ScanGeometry& geometry, double height_m, double stage_m) const;
  double HeightOverTable(const Eigen::Matrix3d& part_rotation) const;
  Reach HeadReach(const ScanGeometry& geometry, double height_m, const ScanTravel& travel,
                  bool every) const;
  Reach PartReach(const ScanGeometry& geometry, const ScanTravel& travel, bool every) const;
  // Empty if the arm can follow the part's travel from a position; otherwise the reason.
  std::string Follow(const ScanGeometry& geometry, const ScanTravel& travel,
                     std::span<const NamedSolid> around, const JointPositions& start,
                     JointPositions* end) const;
  std::vector<NamedSolid> Around(const ScanGeometry& geometry, double height_m,
                                 double stage_m) const;
  std::string MissText(const InverseKinematicsResult& result) const;
  std::string LimitText(int joint, double position) const;

  const CellTask task_;
  const RobotModel model_;
  const InverseKinematics kinematics_;
  const Eigen::Isometry3d to_base_;  // from the cell or the world
  std::vector<CollisionSolid> camera_, laser_, obstacles_;
  std::optional<CollisionSolid> part_;
  std::optional<RobotCollision> collision_;
  std::vector<Eigen::Vector3f> lowest_;  // vertices of the part that may be its lowest ones
};

// Range of stage positions in which a scan can light targets: up to some thousand targets, spread
// over all, that face camera and laser and lie in their fields and range. Occlusion is ignored. A
// spacing is added on both sides. 0 to 0 if no target is lit.
ScanTravel EstimateTravel(const Rig& rig, const TargetSet& targets, double spacing_m,
                          const Eigen::Vector3d& part_centre_m, const Measurement& measurement);

}  // namespace sightline
