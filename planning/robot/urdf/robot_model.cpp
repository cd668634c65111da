// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/urdf/robot_model.h"

#include <urdf_model/model.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/digest/sha256.h"
#include "core/file/no_such_file.h"
#include "core/json/strict_json.h"
#include "core/part/part_digest.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "planning/robot/urdf/robot_mesh.h"
#include "planning/robot/urdf/urdf_file.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr size_t kMostLinks = 200;
constexpr size_t kMostJoints = 16;
constexpr size_t kMostShapes = 2000;
constexpr size_t kMostTriangles = 500000;
constexpr uintmax_t kMostMeshBytes = 256 << 20;  // of all files that meshes are read from
// Largest length in a URDF; larger ones indicate a unit other than metres.
constexpr double kMostMetres = 100;
// Largest limit of a revolute joint in either direction. Published robots have up to 10 rad; a
// limit in degrees is larger even for joints with a narrow range.
constexpr double kMostTurnRad = 4 * std::numbers::pi;
// Velocity of a rotary joint above which a remark is made [rad/s]. The fastest axes of small
// industrial arms reach some 20 rad/s.
constexpr double kFastRadPerS = 8 * std::numbers::pi;

class Reader {
 public:
  explicit Reader(const RobotMount& mount) : mount_(mount) {}

  absl::StatusOr<RobotModel> Read() {
    SIGHTLINE_ASSIGN_OR_RETURN(auto file, ReadUrdfFile(mount_.urdf_file));
    urdf_ = file.model;
    model_.remarks = file.remarks;
    joints_with_limits_ = std::move(file.joints_with_limits);
    joints_with_soft_limits_ = std::move(file.joints_with_soft_limits);
    digest_.Update(file.digest);
    if (urdf_->links_.size() > kMostLinks) {
      return Bad(absl::StrCat("has ", urdf_->links_.size(), " links, at most ", kMostLinks));
    }
    model_.name = urdf_->getName();
    SIGHTLINE_RETURN_IF_ERROR(AddLinks());
    SIGHTLINE_RETURN_IF_ERROR(FindChain());
    for (size_t i = 0; i < model_.links.size(); ++i) {
      SIGHTLINE_RETURN_IF_ERROR(AddShapes(i));
    }
    RemarkOnMissingSolids();
    SIGHTLINE_RETURN_IF_ERROR(SetHome());
    model_.digest = digest_.Hex();
    return std::move(model_);
  }

 private:
  absl::Status Bad(const std::string& reason) const {
    return absl::InvalidArgumentError(absl::StrCat(mount_.urdf_file, ": ", reason));
  }

  absl::Status CheckLength(double value, const std::string& where, bool positive) const {
    if (std::isfinite(value) && std::abs(value) <= kMostMetres && (!positive || value > 0)) {
      return absl::OkStatus();
    }
    return Bad(absl::StrCat(where, " is ", NumberText(value), ", must be in ",
                            positive ? "(0" : "[-100", ", 100] m"));
  }

  absl::StatusOr<Eigen::Isometry3d> PoseOf(const urdf::Pose& pose, const std::string& where) const {
    for (const double value : {pose.position.x, pose.position.y, pose.position.z}) {
      SIGHTLINE_RETURN_IF_ERROR(CheckLength(value, where + ": origin xyz", false));
    }
    const urdf::Rotation& r = pose.rotation;
    Eigen::Quaterniond turn(r.w, r.x, r.y, r.z);
    if (!turn.coeffs().allFinite() || !(turn.norm() > 0.5)) {
      return Bad(where + ": origin rpy is not finite");
    }
    Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
    result.linear() = turn.normalized().toRotationMatrix();
    result.translation() = Eigen::Vector3d(pose.position.x, pose.position.y, pose.position.z);
    return result;
  }

  // From the root down; urdfdom has checked that every link has at most one parent.
  absl::Status AddLinks() {
    const urdf::LinkConstSharedPtr root = urdf_->getRoot();
    if (!root) return Bad("has no root link: its joints make a loop");
    std::vector<urdf::LinkConstSharedPtr> waiting = {root};
    for (size_t next = 0; next < waiting.size(); ++next) {
      const urdf::LinkConstSharedPtr link = waiting[next];
      if (index_.contains(link->name))
        return Bad(absl::StrCat("link ", link->name, " has two parents or is in a loop"));
      index_[link->name] = static_cast<int>(next);
      RobotLink added;
      added.name = link->name;
      if (const urdf::JointSharedPtr& joint = link->parent_joint; joint) {
        added.parent = index_.at(joint->parent_link_name);
        SIGHTLINE_ASSIGN_OR_RETURN(added.origin, PoseOf(joint->parent_to_joint_origin_transform,
                                                        absl::StrCat("joint ", joint->name)));
      }
      model_.links.push_back(std::move(added));
      source_.push_back(link);
      waiting.insert(waiting.end(), link->child_links.begin(), link->child_links.end());
    }
    if (waiting.size() != urdf_->links_.size()) {
      for (const auto& [name, link] : urdf_->links_) {
        if (!index_.contains(name)) {
          return Bad(absl::StrCat(
              "link ", name, " is in a loop: it is not a descendant of the root ", root->name));
        }
      }
    }
    return absl::OkStatus();
  }

  absl::StatusOr<int> LinkNamed(const std::string& name, const char* field) const {
    const auto found = index_.find(name);
    if (found != index_.end()) return found->second;
    std::string names;
    for (const RobotLink& link : model_.links) {
      absl::StrAppend(&names, names.empty() ? "" : ", ", link.name);
      if (names.size() > 300) break;
    }
    return Bad(absl::StrCat("has no link \"", name, "\" (rig.robot.", field, "); it has ", names));
  }

  absl::Status FindChain() {
    if (!mount_.base_link.empty()) {
      SIGHTLINE_ASSIGN_OR_RETURN(model_.base, LinkNamed(mount_.base_link, "base_link"));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(model_.tip, LinkNamed(mount_.tip_link, "tip_link"));
    std::vector<int> chain;
    int link = model_.tip;
    for (; link >= 0 && link != model_.base; link = model_.links[link].parent)
      chain.push_back(link);
    if (link != model_.base) {
      return Bad(absl::StrCat("link ", mount_.tip_link, " is not a descendant of link ",
                              model_.links[model_.base].name));
    }
    std::reverse(chain.begin(), chain.end());
    for (const int i : chain) {
      SIGHTLINE_RETURN_IF_ERROR(AddJoint(*source_[i]->parent_joint, i));
    }
    for (size_t i = 0; i < model_.links.size(); ++i) {
      if (model_.links[i].joint >= 0) continue;
      RemarkOnMimic(i);
      SIGHTLINE_RETURN_IF_ERROR(RestLink(i));
    }
    if (model_.joints.empty()) {
      return Bad(absl::StrCat("has no movable joint between ", model_.links[model_.base].name,
                              " and ", mount_.tip_link));
    }
    if (model_.joints.size() > kMostJoints) {
      return Bad(absl::StrCat("has ", model_.joints.size(), " joints from base to tip, at most ",
                              kMostJoints));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<Eigen::Vector3d> AxisOf(const urdf::Joint& joint) const {
    const Eigen::Vector3d axis(joint.axis.x, joint.axis.y, joint.axis.z);
    if (!axis.allFinite() || !(axis.norm() > 1e-6)) {
      return Bad(absl::StrCat("joint ", joint.name, ": axis is zero or not finite"));
    }
    return Eigen::Vector3d(axis.normalized());
  }

  // Range of a revolute, continuous or prismatic joint with <limit>: within the limits and, if
  // stated, the soft limits of <safety_controller>. By the specification, omitted values of both
  // are 0.
  absl::StatusOr<std::pair<double, double>> RangeOf(const urdf::Joint& joint) const {
    const std::string where = absl::StrCat("joint ", joint.name);
    const auto text = [](double lower, double upper) {
      return absl::StrCat(NumberText(lower), " to ", NumberText(upper));
    };
    const double soft_lower = joint.safety ? joint.safety->soft_lower_limit : 0;
    const double soft_upper = joint.safety ? joint.safety->soft_upper_limit : 0;
    const bool has_soft = soft_lower != 0 || soft_upper != 0;
    if (joint.type == urdf::Joint::CONTINUOUS) {
      if (has_soft) {
        return Bad(absl::StrCat(where,
                                ": turns without end (continuous), but its safety_controller ",
                                "has soft limits ", text(soft_lower, soft_upper),
                                "; make it revolute with <limit> lower and upper"));
      }
      return std::pair(-std::numbers::pi, std::numbers::pi);
    }
    const double lower = joint.limits->lower, upper = joint.limits->upper;
    if (!(std::isfinite(lower) && std::isfinite(upper) && lower < upper)) {
      return Bad(
          absl::StrCat(where, ": limits are ", text(lower, upper), ", lower must be below upper"));
    }
    const bool rotary = joint.type == urdf::Joint::REVOLUTE;
    const double most = rotary ? kMostTurnRad : kMostMetres;
    if (std::max(std::abs(lower), std::abs(upper)) > most) {
      return Bad(absl::StrCat(where, ": limits are ", text(lower, upper),
                              rotary ? " rad, must be in [-4 pi, 4 pi]: they look like degrees; a "
                                       "URDF has radians, and a joint that turns without end is "
                                       "continuous"
                                     : " m, must be in [-100, 100]"));
    }
    if (!has_soft) return std::pair(lower, upper);
    const std::pair within(std::max(lower, soft_lower), std::min(upper, soft_upper));
    if (!(within.first < within.second)) {
      return Bad(absl::StrCat(where, ": limits are ", text(lower, upper),
                              ", the soft limits of its safety_controller are ",
                              text(soft_lower, soft_upper), ": no position is within both"));
    }
    return within;
  }

  absl::Status AddJoint(const urdf::Joint& joint, int link) {
    const std::string where = absl::StrCat("joint ", joint.name);
    if (joint.type == urdf::Joint::FIXED) return absl::OkStatus();
    RobotJoint added;
    added.name = joint.name;
    switch (joint.type) {
      case urdf::Joint::REVOLUTE:
        break;
      case urdf::Joint::CONTINUOUS:
        added.continuous = true;
        break;
      case urdf::Joint::PRISMATIC:
        added.rotary = false;
        break;
      default:
        return Bad(where + ": is neither fixed, revolute, continuous nor prismatic");
    }
    if (joint.mimic) return Bad(where + ": mimics another joint, unsupported in a chain");
    SIGHTLINE_ASSIGN_OR_RETURN(auto axis, AxisOf(joint));
    if (!joint.limits) return Bad(where + ": has no <limit>, whose velocity is needed");
    added.max_speed = joint.limits->velocity;
    if (!std::isfinite(added.max_speed) || !(added.max_speed > 0)) {
      return Bad(absl::StrCat(where, ": limit velocity is ", NumberText(added.max_speed),
                              ", must be above 0"));
    }
    if (added.rotary && added.max_speed > kFastRadPerS) {
      model_.remarks.push_back(
          absl::StrCat(where, ": limit velocity is ", NumberText(added.max_speed),
                       " rad/s, more than arms and tables do; is it in deg/s?"));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(const auto range, RangeOf(joint));
    RemarkOnUnusedLimits(joint);
    added.min = range.first;
    added.max = range.second;
    model_.links[link].axis = axis;
    model_.links[link].joint = static_cast<int>(model_.joints.size());
    model_.joints.push_back(std::move(added));
    return absl::OkStatus();
  }

  // Remarks on limits in the file that have no effect by the specification, though the author may
  // have meant them.
  void RemarkOnUnusedLimits(const urdf::Joint& joint) {
    const double lower = joint.limits->lower, upper = joint.limits->upper;
    if (joint.type == urdf::Joint::CONTINUOUS && joints_with_limits_.contains(joint.name)) {
      model_.remarks.push_back(absl::StrCat(
          "joint ", joint.name, ": its limits ", NumberText(lower), " to ", NumberText(upper),
          " rad have no effect, since it turns without end (continuous)",
          lower < upper ? "; with type=\"revolute\" they bound it"
                        : "; for a fixed joint use type=\"fixed\""));
    }
    if (joint.safety && joint.safety->soft_lower_limit == 0 &&
        joint.safety->soft_upper_limit == 0 && joints_with_soft_limits_.contains(joint.name)) {
      model_.remarks.push_back(
          absl::StrCat("joint ", joint.name,
                       ": the soft limits 0 to 0 of its safety_controller have no effect; the "
                       "joint is bounded by <limit> alone"));
    }
  }

  // A joint outside the chain stays fixed, even if it would move with a joint of the chain.
  void RemarkOnMimic(size_t i) {
    const urdf::JointSharedPtr& joint = source_[i]->parent_joint;
    if (!joint || !joint->mimic) return;
    const std::string& mimicked = joint->mimic->joint_name;
    if (std::ranges::find(model_.joints, mimicked, &RobotJoint::name) == model_.joints.end())
      return;
    model_.remarks.push_back(absl::StrCat("joint ", joint->name, " mimics joint ", mimicked,
                                          " of the chain; it is treated as fixed"));
  }

  // Moves a link outside the chain to its joint's rest position: 0, or the limit nearest to it.
  absl::Status RestLink(size_t i) {
    const urdf::JointSharedPtr& joint = source_[i]->parent_joint;
    if (!joint) return absl::OkStatus();
    const bool rotary = joint->type == urdf::Joint::REVOLUTE;
    if (!rotary && joint->type != urdf::Joint::PRISMATIC) return absl::OkStatus();
    if (!joint->limits || joint->limits->lower == joint->limits->upper) return absl::OkStatus();
    // A joint whose range contains 0 rests there, regardless of the unit of its limits.
    const bool soft_at_0 = !joint->safety || (joint->safety->soft_lower_limit <= 0 &&
                                              joint->safety->soft_upper_limit >= 0);
    if (joint->limits->lower <= 0 && joint->limits->upper >= 0 && soft_at_0) {
      return absl::OkStatus();
    }
    SIGHTLINE_ASSIGN_OR_RETURN(const auto range, RangeOf(*joint));
    const double at = std::clamp(0.0, range.first, range.second);
    SIGHTLINE_ASSIGN_OR_RETURN(auto axis, AxisOf(*joint));
    if (rotary) {
      model_.links[i].origin.rotate(Eigen::AngleAxisd(at, axis));
    } else {
      model_.links[i].origin.translate(at * axis);
    }
    return absl::OkStatus();
  }

  // Only solids of <collision> are checked for collisions. A link with <visual> alone, or an arm
  // without any solid, passes through everything.
  void RemarkOnMissingSolids() {
    constexpr size_t kMostNamed = 5;
    std::vector<std::string> drawn_only;
    std::vector<bool> moves(model_.links.size());
    bool moving_solid = false;
    for (size_t i = 0; i < model_.links.size(); ++i) {
      const RobotLink& link = model_.links[i];
      moves[i] = link.joint >= 0 || (link.parent >= 0 && moves[static_cast<size_t>(link.parent)]);
      moving_solid |= moves[i] && !link.shapes.empty();
      if (link.shapes.empty() && source_[i]->visual) drawn_only.push_back(link.name);
    }
    if (!moving_solid) {
      model_.remarks.push_back(
          "no link that moves has a solid (<collision>): collisions of the robot are not noticed");
    }
    if (drawn_only.empty()) return;
    const size_t count = drawn_only.size();
    drawn_only.resize(std::min(count, kMostNamed));
    model_.remarks.push_back(absl::StrCat(
        count == 1 ? "link " : "links ", absl::StrJoin(drawn_only, ", "),
        count > kMostNamed ? absl::StrCat(" and ", count - kMostNamed, " more") : "",
        count == 1 ? " has" : " have", " a <visual> but no <collision>: collisions with ",
        count == 1 ? "it" : "them", " are not noticed"));
  }

  absl::StatusOr<MeshShape> MeshOf(const urdf::Mesh& mesh, const std::string& where) {
    std::string name = mesh.filename;
    if (name.starts_with("file://") || name.starts_with("package://") ||
        name.find("://") != name.npos) {
      return Bad(
          absl::StrCat(where, ": mesh ", name, " is a link; give its path relative to the URDF"));
    }
    const fs::path relative = fs::path(name).lexically_normal();
    if (name.empty() || relative.is_absolute() || relative.begin()->string() == "..") {
      return Bad(
          absl::StrCat(where, ": mesh \"", name, "\" must be a path below the folder of the URDF"));
    }
    const fs::path path = fs::path(mount_.urdf_file).parent_path() / relative;
    std::error_code error;
    if (!fs::exists(path, error)) {
      const std::string other = NameInOtherCase(path.string());
      return absl::NotFoundError(absl::StrCat(mount_.urdf_file, ": ", where, ": mesh ",
                                              path.string(),
                                              other.empty() ? ": no such file" : other));
    }
    if (!fs::is_regular_file(path, error)) {
      return Bad(absl::StrCat(where, ": mesh ", path.string(), " is not a regular file"));
    }
    const Eigen::Vector3d scale(mesh.scale.x, mesh.scale.y, mesh.scale.z);
    // Thousands of solids may use the same file, so it is read only once.
    MeshShape& known = meshes_[{path.string(), {scale.x(), scale.y(), scale.z()}}];
    if (known == nullptr) {
      mesh_bytes_ += fs::file_size(path, error);
      if (error || mesh_bytes_ > kMostMeshBytes) {
        return Bad(absl::StrCat(where, ": mesh ", path.string(), ": mesh files have more than ",
                                kMostMeshBytes, " bytes together"));
      }
      auto loaded = LoadRobotMesh(path.string(), scale);
      if (!loaded.ok()) {
        return absl::Status(loaded.status().code(), absl::StrCat(mount_.urdf_file, ": ", where,
                                                                 ": ", loaded.status().message()));
      }
      for (const std::string& remark : loaded->remarks) {
        model_.remarks.push_back(absl::StrCat(where, ": ", path.string(), ": ", remark));
      }
      known = std::make_shared<const TriangleMesh>(*std::move(loaded));
    }
    triangles_ += known->triangles.size();
    if (triangles_ > kMostTriangles) {
      return Bad(absl::StrCat("has meshes of more than ", kMostTriangles, " triangles"));
    }
    digest_.Update(PartDigestOf(*known).Text());
    return known;
  }

  absl::Status AddShapes(size_t i) {
    const urdf::Link& link = *source_[i];
    const std::string where = absl::StrCat("link ", link.name);
    std::vector<urdf::CollisionSharedPtr> collisions = link.collision_array;
    if (collisions.empty() && link.collision) collisions.push_back(link.collision);
    for (const urdf::CollisionSharedPtr& collision : collisions) {
      if (++shapes_ > kMostShapes) {
        return Bad(absl::StrCat("has more than ", kMostShapes, " solids"));
      }
      if (!collision || !collision->geometry) return Bad(where + ": <collision> has no <geometry>");
      SIGHTLINE_ASSIGN_OR_RETURN(auto pose, PoseOf(collision->origin, where + ": collision"));
      Shape shape;
      shape.pose = pose;
      switch (collision->geometry->type) {
        case urdf::Geometry::BOX: {
          const auto& box = static_cast<const urdf::Box&>(*collision->geometry);
          for (const double size : {box.dim.x, box.dim.y, box.dim.z}) {
            SIGHTLINE_RETURN_IF_ERROR(CheckLength(size, where + ": box size", true));
          }
          shape.solid = BoxShape{{box.dim.x, box.dim.y, box.dim.z}};
          break;
        }
        case urdf::Geometry::CYLINDER: {
          const auto& cylinder = static_cast<const urdf::Cylinder&>(*collision->geometry);
          for (const double size : {cylinder.radius, cylinder.length}) {
            SIGHTLINE_RETURN_IF_ERROR(CheckLength(size, where + ": cylinder", true));
          }
          shape.solid = CylinderShape{cylinder.radius, cylinder.length};
          break;
        }
        case urdf::Geometry::SPHERE: {
          const auto& sphere = static_cast<const urdf::Sphere&>(*collision->geometry);
          SIGHTLINE_RETURN_IF_ERROR(CheckLength(sphere.radius, where + ": sphere radius", true));
          shape.solid = SphereShape{sphere.radius};
          break;
        }
        case urdf::Geometry::MESH: {
          SIGHTLINE_ASSIGN_OR_RETURN(
              shape.solid, MeshOf(static_cast<const urdf::Mesh&>(*collision->geometry), where));
          break;
        }
      }
      model_.links[i].shapes.push_back(std::move(shape));
    }
    return absl::OkStatus();
  }

  absl::Status SetHome() {
    const size_t joints = model_.joints.size();
    if (mount_.home.empty()) {
      for (const RobotJoint& joint : model_.joints)
        model_.home.push_back((joint.min + joint.max) / 2);
      return absl::OkStatus();
    }
    if (mount_.home.size() != joints) {
      return absl::InvalidArgumentError(absl::StrCat("rig.robot.home_position has ",
                                                     mount_.home.size(), " entries, the chain of ",
                                                     mount_.urdf_file, " has ", joints, " joints"));
    }
    for (size_t j = 0; j < joints; ++j) {
      const RobotJoint& joint = model_.joints[j];
      if (joint.continuous || (mount_.home[j] >= joint.min && mount_.home[j] <= joint.max))
        continue;
      return absl::InvalidArgumentError(absl::StrCat(
          "rig.robot.home_position[", j, "] is ", NumberText(mount_.home[j]), ", joint ",
          joint.name, " allows [", NumberText(joint.min), ", ", NumberText(joint.max), "]"));
    }
    model_.home = mount_.home;
    return absl::OkStatus();
  }

  const RobotMount& mount_;
  urdf::ModelInterfaceSharedPtr urdf_;
  RobotModel model_;
  std::map<std::string, int> index_;
  std::vector<urdf::LinkConstSharedPtr> source_;  // of each link
  std::set<std::string> joints_with_limits_, joints_with_soft_limits_;
  Sha256 digest_;
  std::map<std::pair<std::string, std::array<double, 3>>, MeshShape> meshes_;  // by path and scale
  uintmax_t mesh_bytes_ = 0;
  size_t triangles_ = 0, shapes_ = 0;
};

}  // namespace

std::vector<Eigen::Isometry3d> RobotModel::LinkPoses(const JointPositions& q) const {
  std::vector<Eigen::Isometry3d> poses(links.size());
  for (size_t i = 0; i < links.size(); ++i) {
    const RobotLink& link = links[i];
    Eigen::Isometry3d pose =
        link.parent < 0 ? Eigen::Isometry3d::Identity() : poses[link.parent] * link.origin;
    if (link.joint >= 0) {
      if (joints[link.joint].rotary) {
        pose.rotate(Eigen::AngleAxisd(q[link.joint], link.axis));
      } else {
        pose.translate(q[link.joint] * link.axis);
      }
    }
    poses[i] = pose;
  }
  const Eigen::Isometry3d to_base = poses[base].inverse();
  for (Eigen::Isometry3d& pose : poses) pose = to_base * pose;
  return poses;
}

absl::StatusOr<RobotModel> ReadRobotModel(const RobotMount& mount) { return Reader(mount).Read(); }

}  // namespace sightline
