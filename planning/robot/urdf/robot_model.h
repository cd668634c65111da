// SPDX-License-Identifier: Apache-2.0
// A serial arm or table: links, their solids, and the joints between its base and its tip.
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/robot_mount.h"
#include "core/part/mesh.h"

namespace sightline {

struct BoxShape {
  Eigen::Vector3d size_m;  // full edge lengths
};
// Axis along z, origin in the middle.
struct CylinderShape {
  double radius_m, length_m;
};
struct SphereShape {
  double radius_m;
};
using MeshShape = std::shared_ptr<const TriangleMesh>;

struct Shape {
  std::variant<BoxShape, CylinderShape, SphereShape, MeshShape> solid;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // in the frame of its link
};

// A joint of the chain. Positions are rad of rotary joints and m of linear ones.
struct RobotJoint {
  std::string name;
  bool rotary = true;
  bool continuous = false;  // turns without end: no limits
  double min = 0, max = 0;  // soft limits of the URDF included; continuous: -pi, pi
  double max_speed = 0;     // rad/s or m/s, of the URDF
};

struct RobotLink {
  std::string name;
  int parent = -1;  // index, smaller than the link's own; -1: the root
  // x_parent = origin * motion(q) * x_link, motion a turn about or a shift along `axis`.
  Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();
  int joint = -1;             // index into joints; -1: does not move
  std::vector<Shape> shapes;  // shapes for collisions
};

// Joint positions in the order of the chain.
using JointPositions = std::vector<double>;

struct RobotModel {
  std::string name;
  std::vector<RobotLink> links;  // parents before children
  std::vector<RobotJoint> joints;
  int base = 0, tip = 0;  // indices of links
  JointPositions home;
  std::string digest;                // of the URDF and its meshes
  std::vector<std::string> remarks;  // omissions and likely oversights, a sentence each

  // Pose of every link in the frame of the base link; q has one number per joint.
  std::vector<Eigen::Isometry3d> LinkPoses(const JointPositions& q) const;
};

// Reads the chain from mount.base_link to mount.tip_link of a URDF. Other links are fixed to the
// chain: movable ones at joint position 0, or at the limit nearest to 0. Solids are those of
// <collision>. Meshes are .stl, .obj, .ply, .glb or .gltf in metres times their scale, below the
// folder of the URDF. NOT_FOUND and INVALID_ARGUMENT name file and reason: words outside the URDF
// specification, joints without limits or speed or with limits in degrees, loops, numbers that are
// not finite, more than 200 links, 16 joints or 500 000 triangles, or chain joints that are planar,
// floating or mimic others. If home has the wrong length or exceeds the limits, the message names
// the field of the inspection.
absl::StatusOr<RobotModel> ReadRobotModel(const RobotMount& mount);

}  // namespace sightline
