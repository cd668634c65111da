// SPDX-License-Identifier: Apache-2.0
// Collision checks of an arm with itself and with its surroundings (FCL).
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/rig/rig.h"
#include "planning/robot/urdf/robot_model.h"

namespace sightline {

// Solids of the arm keep this distance [m] from surroundings. Solids given as meshes are not
// enlarged. Motions are checked in steps of at most twice this distance, so that no step passes
// through a solid.
inline constexpr double kClearanceM = 0.005;

// A solid for FCL, built once and used by any number of threads.
class CollisionSolid {
 public:
  // `enlarged_m`: added on every side, except for meshes.
  static CollisionSolid FromShape(const Shape& shape, double enlarged_m);
  // In the frame of its sensor.
  static CollisionSolid FromBody(const Body& body, double enlarged_m);
  static CollisionSolid FromMesh(const TriangleMesh& mesh);
  static CollisionSolid FromBox(const Eigen::Vector3d& size_m);
  struct Geometry;
  const Geometry& geometry() const { return *geometry_; }
  // Bounds in the solid's own frame, which already contains the pose of a shape.
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }

 private:
  std::shared_ptr<const Geometry> geometry_;
  Eigen::AlignedBox3d bounds_;
};

// True if two solids touch, each at its pose in a common frame.
bool Touch(const CollisionSolid& a, const Eigen::Isometry3d& pose_a, const CollisionSolid& b,
           const Eigen::Isometry3d& pose_b);

// A solid that stands around the arm.
struct NamedSolid {
  std::string name;
  CollisionSolid solid;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

// A solid that the tip carries, as it is and enlarged by kClearanceM; poses in the tip's frame.
struct LoadSolid {
  std::string name;
  CollisionSolid solid, enlarged;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

struct Contact {
  std::string first, second;  // names of a link or load, and of the solid that it touches
};

class RobotCollision {
 public:
  // `load`: solids fixed to the tip link. `model` must outlive it.
  RobotCollision(const RobotModel& model, const std::vector<LoadSolid>& load);

  // Contact between links that are not neighbours, or between the load and links not fixed to the
  // tip. Links joined by a joint are neighbours, also across links without solids. Pairs that touch
  // in all of 64 spread positions are allowed: they touch by construction.
  std::optional<Contact> WithItself(std::span<const Eigen::Isometry3d> links) const;

  // Contact of arm and load (`with_load`) with solids fixed in the frame of the base link. Links
  // that do not move with the chain are ignored, since their place was chosen on purpose.
  std::optional<Contact> WithSurroundings(std::span<const Eigen::Isometry3d> links,
                                          std::span<const NamedSolid> around, bool with_load) const;

  // The same while `around` is shifted along a straight line from `from_m` to `to_m`, in steps of
  // at most 2 kClearanceM.
  std::optional<Contact> WithMovingSurroundings(std::span<const Eigen::Isometry3d> links,
                                                std::span<const NamedSolid> around,
                                                const Eigen::Vector3d& from_m,
                                                const Eigen::Vector3d& to_m, bool with_load) const;

  // Upper bound on the motion of any point of arm and load between two positions [m].
  double FarthestMotion(const JointPositions& from, const JointPositions& to) const;

 private:
  struct Piece {
    int link;
    bool load;
    bool moves;
    std::string name;
    CollisionSolid solid, enlarged;
    Eigen::Isometry3d pose;
  };
  bool MayTouch(const Piece& a, const Piece& b) const;

  const RobotModel& model_;
  std::vector<Piece> pieces_;
  std::vector<int> body_;                   // of each link: the moving body that it is fixed to
  std::vector<std::vector<bool>> allowed_;  // by pair of links: they may touch
  // Largest distance of any point of arm and load from each joint's axis or origin [m].
  std::vector<double> lever_m_;
};

}  // namespace sightline
