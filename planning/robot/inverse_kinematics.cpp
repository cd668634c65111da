// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/inverse_kinematics.h"

#include <algorithm>
#include <cmath>
#include <kdl/chainiksolverpos_lma.hpp>
#include <limits>
#include <numbers>

namespace sightline {
namespace {

constexpr int kStarts = 24;
// An arm of six joints has at most 16 solutions; usual arms have 8.
constexpr size_t kMostSolutions = 16;
constexpr int kIterations = 100;
constexpr int kFollowIterations = 30;
// Positions that differ by less [rad or m] count as the same solution.
constexpr double kSame = 1e-3;
// Weight of a radian against a metre; KDL's default weights rotation too little.
constexpr double kRotationWeight = 0.3;
constexpr double kEnough = 1e-7;  // of the weighted distance

KDL::Vector ToKdl(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

KDL::Frame ToKdl(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix3d& m = pose.linear();
  return {KDL::Rotation(m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1),
                        m(2, 2)),
          ToKdl(Eigen::Vector3d(pose.translation()))};
}

Eigen::Matrix<double, 6, 1> Weights() {
  Eigen::Matrix<double, 6, 1> weights;
  weights << 1, 1, 1, kRotationWeight, kRotationWeight, kRotationWeight;
  return weights;
}

}  // namespace

double RadicalInverse(int base, int n) {
  double result = 0, digit = 1.0 / base;
  for (; n > 0; n /= base, digit /= base) result += n % base * digit;
  return result;
}

InverseKinematics::InverseKinematics(const RobotModel& model) : model_(model) {
  std::vector<int> path;
  for (int link = model.tip; link != model.base; link = model.links[link].parent) {
    path.push_back(link);
  }
  std::reverse(path.begin(), path.end());
  Eigen::Isometry3d before = Eigen::Isometry3d::Identity();
  bool moved = false;
  for (const int i : path) {
    const RobotLink& link = model.links[i];
    if (moved) longest_reach_m_ += link.origin.translation().norm();
    if (link.joint < 0) {
      chain_.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), ToKdl(link.origin)));
      if (!moved) before = before * link.origin;
      continue;
    }
    const RobotJoint& joint = model.joints[link.joint];
    if (!moved) first_joint_m_ = (before * link.origin).translation();
    moved = true;
    if (!joint.rotary) longest_reach_m_ += std::max(std::abs(joint.min), std::abs(joint.max));
    chain_.addSegment(
        KDL::Segment(KDL::Joint(ToKdl(Eigen::Vector3d(link.origin.translation())),
                                ToKdl(Eigen::Vector3d(link.origin.linear() * link.axis)),
                                joint.rotary ? KDL::Joint::RotAxis : KDL::Joint::TransAxis),
                     ToKdl(link.origin)));
  }
  starts_.push_back(model.home);
  for (int n = 1; n < kStarts; ++n) {
    JointPositions start;
    for (size_t j = 0; j < model.joints.size(); ++j) {
      // Positions beyond one full turn repeat earlier ones.
      const RobotJoint& joint = model.joints[j];
      const double middle = (joint.min + joint.max) / 2;
      const double half = joint.rotary ? std::min((joint.max - joint.min) / 2, std::numbers::pi)
                                       : (joint.max - joint.min) / 2;
      start.push_back(middle + half * (2 * RadicalInverse(kHaltonBases[j], n) - 1));
    }
    starts_.push_back(std::move(start));
  }
}

std::pair<double, double> InverseKinematics::Distance(const Eigen::Isometry3d& tip,
                                                      const JointPositions& q) const {
  const Eigen::Isometry3d at = model_.LinkPoses(q)[model_.tip];
  return {(at.translation() - tip.translation()).norm(),
          Eigen::AngleAxisd(at.linear().transpose() * tip.linear()).angle()};
}

JointPositions InverseKinematics::WithoutTurns(JointPositions q, const JointPositions& near) const {
  constexpr double kTurn = 2 * std::numbers::pi;
  for (size_t j = 0; j < q.size(); ++j) {
    const RobotJoint& joint = model_.joints[j];
    if (!joint.rotary) continue;
    q[j] = near[j] + std::remainder(q[j] - near[j], kTurn);
    if (joint.continuous) continue;
    // If the position is beyond a limit, one turn back may be inside the range.
    if (q[j] > joint.max && q[j] - kTurn >= joint.min) q[j] -= kTurn;
    if (q[j] < joint.min && q[j] + kTurn <= joint.max) q[j] += kTurn;
  }
  return q;
}

InverseKinematicsResult InverseKinematics::Solve(
    const Eigen::Isometry3d& tip, const std::function<bool(const JointPositions&)>& enough) const {
  using Miss = InverseKinematicsResult::Miss;
  InverseKinematicsResult result;
  result.miss = Miss::kReach;
  result.miss_m = std::numeric_limits<double>::infinity();
  const double distance_m = (tip.translation() - first_joint_m_).norm();
  if (distance_m > longest_reach_m_ + kPositionToleranceM) {
    result.miss_m = distance_m - longest_reach_m_;
    return result;
  }
  // Joints cache their last pose and the solver refers to them, so each thread needs a copy.
  const KDL::Chain chain = chain_;
  KDL::ChainIkSolverPos_LMA solver(chain, Weights(), kEnough, kIterations);
  const KDL::Frame goal = ToKdl(tip);
  const auto joints = static_cast<unsigned>(model_.joints.size());
  KDL::JntArray from(joints), to(joints);
  double least_violation = std::numeric_limits<double>::infinity();
  for (const JointPositions& start : starts_) {
    for (unsigned j = 0; j < joints; ++j) from(j) = start[j];
    solver.CartToJnt(from, goal, to);
    JointPositions q(to.data.data(), to.data.data() + joints);
    if (!std::all_of(q.begin(), q.end(), [](double x) { return std::isfinite(x); })) continue;
    q = WithoutTurns(std::move(q), model_.home);
    const auto [miss_m, miss_rad] = Distance(tip, q);
    if (miss_m > kPositionToleranceM || miss_rad > kAngleToleranceRad) {
      if (miss_m + kRotationWeight * miss_rad < result.miss_m + kRotationWeight * result.miss_rad) {
        result.miss_m = miss_m;
        result.miss_rad = miss_rad;
      }
      continue;
    }
    int worst = -1;
    double violation = 0;
    for (unsigned j = 0; j < joints; ++j) {
      const RobotJoint& joint = model_.joints[j];
      if (joint.continuous) continue;
      const double beyond = std::max(joint.min - q[j], q[j] - joint.max);
      if (beyond > violation) {
        violation = beyond;
        worst = static_cast<int>(j);
      }
    }
    if (worst >= 0) {
      if (violation < least_violation) {
        least_violation = violation;
        result.limit_joint = worst;
        result.limit_position = q[static_cast<size_t>(worst)];
      }
      continue;
    }
    const bool known = std::any_of(result.solutions.begin(), result.solutions.end(),
                                   [&](const JointPositions& other) {
                                     for (unsigned j = 0; j < joints; ++j) {
                                       if (std::abs(other[j] - q[j]) > kSame) return false;
                                     }
                                     return true;
                                   });
    if (known) continue;
    result.solutions.push_back(q);
    if (result.solutions.size() == kMostSolutions || enough(q)) break;
  }
  if (!result.solutions.empty()) {
    result.miss = Miss::kNone;
  } else if (result.limit_joint >= 0) {
    result.miss = Miss::kLimit;
  }
  return result;
}

JointPositions InverseKinematics::Follow(const Eigen::Isometry3d& tip, const JointPositions& from,
                                         bool* reached) const {
  const KDL::Chain chain = chain_;  // see Solve
  KDL::ChainIkSolverPos_LMA solver(chain, Weights(), kEnough, kFollowIterations);
  const auto joints = static_cast<unsigned>(model_.joints.size());
  KDL::JntArray start(joints), to(joints);
  for (unsigned j = 0; j < joints; ++j) start(j) = from[j];
  solver.CartToJnt(start, ToKdl(tip), to);
  JointPositions q(to.data.data(), to.data.data() + joints);
  *reached = std::all_of(q.begin(), q.end(), [](double x) { return std::isfinite(x); });
  if (!*reached) return from;
  const auto [miss_m, miss_rad] = Distance(tip, q);
  *reached = miss_m <= kPositionToleranceM && miss_rad <= kAngleToleranceRad;
  return q;
}

}  // namespace sightline
