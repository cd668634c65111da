// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/robot_collision.h"

#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/narrowphase/collision.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "planning/robot/inverse_kinematics.h"

namespace sightline {

struct CollisionSolid::Geometry {
  std::shared_ptr<fcl::CollisionGeometryd> solid;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
};

namespace {

constexpr int kSpreadPositions = 64;

Eigen::AlignedBox3d Transformed(const Eigen::AlignedBox3d& box, const Eigen::Isometry3d& pose) {
  const Eigen::Vector3d centre = pose * box.center();
  const Eigen::Vector3d half = pose.linear().cwiseAbs() * (0.5 * box.sizes());
  return {centre - half, centre + half};
}

std::shared_ptr<fcl::CollisionGeometryd> MeshGeometry(const TriangleMesh& mesh) {
  auto model = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
  std::vector<fcl::Vector3d> points;
  points.reserve(mesh.positions_m.size());
  for (const Eigen::Vector3f& p : mesh.positions_m) points.push_back(p.cast<double>());
  std::vector<fcl::Triangle> triangles;
  triangles.reserve(mesh.triangles.size());
  for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
  model->beginModel(static_cast<int>(triangles.size()), static_cast<int>(points.size()));
  model->addSubModel(points, triangles);
  model->endModel();
  return model;
}

CollisionSolid::Geometry Finish(std::shared_ptr<fcl::CollisionGeometryd> solid,
                                const Eigen::Isometry3d& pose, Eigen::AlignedBox3d* bounds) {
  solid->computeLocalAABB();
  *bounds = Transformed({solid->aabb_local.min_, solid->aabb_local.max_}, pose);
  return {std::move(solid), pose};
}

}  // namespace

CollisionSolid CollisionSolid::FromShape(const Shape& shape, double e) {
  std::shared_ptr<fcl::CollisionGeometryd> solid;
  if (const auto* box = std::get_if<BoxShape>(&shape.solid)) {
    const Eigen::Vector3d size = box->size_m + Eigen::Vector3d::Constant(2 * e);
    solid = std::make_shared<fcl::Boxd>(size);
  } else if (const auto* cylinder = std::get_if<CylinderShape>(&shape.solid)) {
    solid = std::make_shared<fcl::Cylinderd>(cylinder->radius_m + e, cylinder->length_m + 2 * e);
  } else if (const auto* sphere = std::get_if<SphereShape>(&shape.solid)) {
    solid = std::make_shared<fcl::Sphered>(sphere->radius_m + e);
  } else {
    solid = MeshGeometry(*std::get<MeshShape>(shape.solid));
  }
  CollisionSolid result;
  result.geometry_ =
      std::make_shared<const Geometry>(Finish(std::move(solid), shape.pose, &result.bounds_));
  return result;
}

CollisionSolid CollisionSolid::FromBody(const Body& body, double enlarged_m) {
  Shape shape;
  if (const auto* box = std::get_if<BoxBody>(&body)) {
    shape.solid = BoxShape{box->size_m};
    shape.pose.translation() = box->centre_m;
  } else {
    const auto& cylinder = std::get<CylinderBody>(body);
    shape.solid = CylinderShape{cylinder.radius_m, cylinder.length_m};
    shape.pose.translation() = cylinder.centre_m;
  }
  return FromShape(shape, enlarged_m);
}

CollisionSolid CollisionSolid::FromMesh(const TriangleMesh& mesh) {
  CollisionSolid result;
  result.geometry_ = std::make_shared<const Geometry>(
      Finish(MeshGeometry(mesh), Eigen::Isometry3d::Identity(), &result.bounds_));
  return result;
}

CollisionSolid CollisionSolid::FromBox(const Eigen::Vector3d& size_m) {
  return FromShape({BoxShape{size_m}, Eigen::Isometry3d::Identity()}, 0);
}

bool Touch(const CollisionSolid& a, const Eigen::Isometry3d& pose_a, const CollisionSolid& b,
           const Eigen::Isometry3d& pose_b) {
  if (!Transformed(a.bounds(), pose_a).intersects(Transformed(b.bounds(), pose_b))) return false;
  const fcl::CollisionRequestd request;
  fcl::CollisionResultd result;
  return fcl::collide(a.geometry().solid.get(), pose_a * a.geometry().pose,
                      b.geometry().solid.get(), pose_b * b.geometry().pose, request, result) > 0;
}

RobotCollision::RobotCollision(const RobotModel& model, const std::vector<LoadSolid>& load)
    : model_(model) {
  const size_t links = model.links.size();
  // Links that a joint of the chain moves, with all links attached to them.
  std::vector<bool> moves(links, false);
  for (size_t i = 0; i < links; ++i) {
    const RobotLink& link = model.links[i];
    moves[i] = link.joint >= 0 || (link.parent >= 0 && moves[link.parent]);
    for (const Shape& shape : link.shapes) {
      pieces_.push_back(
          {static_cast<int>(i), false, moves[i], link.name, CollisionSolid::FromShape(shape, 0),
           CollisionSolid::FromShape(shape, kClearanceM), Eigen::Isometry3d::Identity()});
    }
  }
  for (const LoadSolid& solid : load) {
    pieces_.push_back({model.tip, true, true, solid.name, solid.solid, solid.enlarged, solid.pose});
  }

  // Neighbours are links joined directly or through links without solids; links fixed to each other
  // count as one.
  std::vector<int>& body = body_;
  body.resize(links);
  for (size_t i = 0; i < links; ++i) {
    const RobotLink& link = model.links[i];
    body[i] = link.joint >= 0 || link.parent < 0 ? static_cast<int>(i) : body[link.parent];
  }
  std::vector<bool> solid(links, false);
  for (const Piece& piece : pieces_) solid[body[piece.link]] = true;
  allowed_.assign(links, std::vector<bool>(links, false));
  for (size_t i = 0; i < links; ++i) {
    for (size_t k = 0; k < links; ++k) {
      if (body[i] == body[k]) allowed_[i][k] = true;
    }
    if (!solid[body[i]]) continue;
    int up = model.links[body[i]].parent;
    while (up >= 0 && !solid[body[up]]) up = model.links[body[up]].parent;
    if (up < 0) continue;
    for (size_t k = 0; k < links; ++k) {
      if (body[k] == body[up]) allowed_[i][k] = allowed_[k][i] = true;
    }
  }
  std::vector<std::vector<int>> touches(links, std::vector<int>(links, 0));
  for (int n = 0; n < kSpreadPositions; ++n) {
    JointPositions q;
    for (size_t j = 0; j < model.joints.size(); ++j) {
      const RobotJoint& joint = model.joints[j];
      q.push_back(joint.min + (joint.max - joint.min) * RadicalInverse(kHaltonBases[j], n + 1));
    }
    const auto poses = model.LinkPoses(q);
    std::vector<std::vector<bool>> touch(links, std::vector<bool>(links, false));
    for (size_t a = 0; a < pieces_.size(); ++a) {
      for (size_t b = a + 1; b < pieces_.size(); ++b) {
        const Piece &p = pieces_[a], &r = pieces_[b];
        if (p.load || r.load || !MayTouch(p, r) || touch[p.link][r.link]) continue;
        touch[p.link][r.link] =
            Touch(p.solid, poses[p.link] * p.pose, r.solid, poses[r.link] * r.pose);
      }
    }
    for (size_t i = 0; i < links; ++i) {
      for (size_t k = 0; k < links; ++k) touches[i][k] += touch[i][k];
    }
  }
  for (size_t i = 0; i < links; ++i) {
    for (size_t k = 0; k < links; ++k) {
      if (touches[i][k] == kSpreadPositions) allowed_[i][k] = allowed_[k][i] = true;
    }
  }

  // Largest distance from a joint of anything that it moves: along the chain, link by link.
  std::vector<double> reach_m(links, 0);
  for (const Piece& piece : pieces_) {
    const Eigen::AlignedBox3d box = Transformed(piece.enlarged.bounds(), piece.pose);
    const double radius_m = box.center().norm() + 0.5 * box.diagonal().norm();
    reach_m[piece.link] = std::max(reach_m[piece.link], radius_m);
  }
  for (size_t i = links; i-- > 1;) {
    const RobotLink& link = model.links[i];
    double here_m = reach_m[i] + link.origin.translation().norm();
    if (link.joint >= 0 && !model.joints[link.joint].rotary) {
      const RobotJoint& joint = model.joints[link.joint];
      here_m += std::max(std::abs(joint.min), std::abs(joint.max));
    }
    if (link.parent >= 0) reach_m[link.parent] = std::max(reach_m[link.parent], here_m);
  }
  lever_m_.assign(model.joints.size(), 0);
  for (size_t i = 0; i < links; ++i) {
    const int joint = model.links[i].joint;
    if (joint >= 0) lever_m_[joint] = model.joints[joint].rotary ? reach_m[i] : 1;
  }
}

bool RobotCollision::MayTouch(const Piece& a, const Piece& b) const {
  if (!a.moves && !b.moves) return false;
  return !allowed_[a.link][b.link];
}

std::optional<Contact> RobotCollision::WithItself(std::span<const Eigen::Isometry3d> links) const {
  for (size_t a = 0; a < pieces_.size(); ++a) {
    for (size_t b = a + 1; b < pieces_.size(); ++b) {
      const Piece &p = pieces_[a], &r = pieces_[b];
      // The load may touch the link that it is fixed to, but not that link's neighbours.
      const bool looked_at =
          p.load != r.load ? body_[p.link] != body_[r.link] : !p.load && MayTouch(p, r);
      if (!looked_at) continue;
      if (Touch(p.solid, links[p.link] * p.pose, r.solid, links[r.link] * r.pose)) {
        return Contact{r.load ? r.name : p.name, r.load ? p.name : r.name};
      }
    }
  }
  return std::nullopt;
}

std::optional<Contact> RobotCollision::WithSurroundings(std::span<const Eigen::Isometry3d> links,
                                                        std::span<const NamedSolid> around,
                                                        bool with_load) const {
  return WithMovingSurroundings(links, around, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                                with_load);
}

std::optional<Contact> RobotCollision::WithMovingSurroundings(
    std::span<const Eigen::Isometry3d> links, std::span<const NamedSolid> around,
    const Eigen::Vector3d& from_m, const Eigen::Vector3d& to_m, bool with_load) const {
  const double length_m = (to_m - from_m).norm();
  const int steps = static_cast<int>(std::ceil(length_m / (2 * kClearanceM)));
  for (const Piece& piece : pieces_) {
    if (!piece.moves || (piece.load && !with_load)) continue;
    const Eigen::Isometry3d pose = links[piece.link] * piece.pose;
    const Eigen::AlignedBox3d here = Transformed(piece.enlarged.bounds(), pose);
    for (const NamedSolid& other : around) {
      const Eigen::AlignedBox3d box = Transformed(other.solid.bounds(), other.pose);
      Eigen::AlignedBox3d swept = box.translated(from_m);
      swept.extend(box.translated(to_m));
      if (!here.intersects(swept)) continue;
      for (int k = 0; k <= steps; ++k) {
        Eigen::Isometry3d there = other.pose;
        there.pretranslate(steps == 0 ? from_m
                                      : Eigen::Vector3d(from_m + (to_m - from_m) * k / steps));
        if (Touch(piece.enlarged, pose, other.solid, there)) return Contact{piece.name, other.name};
      }
    }
  }
  return std::nullopt;
}

double RobotCollision::FarthestMotion(const JointPositions& from, const JointPositions& to) const {
  double sum_m = 0;
  for (size_t j = 0; j < from.size(); ++j) sum_m += std::abs(to[j] - from[j]) * lever_m_[j];
  return sum_m;
}

}  // namespace sightline
