// SPDX-License-Identifier: Apache-2.0
// Joint positions that bring the tip of a chain to a pose: Levenberg-Marquardt (KDL) from fixed
// starts, so that the same pose has the same solutions.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <functional>
#include <kdl/chain.hpp>
#include <optional>
#include <string>
#include <vector>

#include "planning/robot/urdf/robot_model.h"

namespace sightline {

// A pose counts as reached within these, less than arms repeat.
inline constexpr double kPositionToleranceM = 2e-5;
inline constexpr double kAngleToleranceRad = 1e-4;

struct InverseKinematicsResult {
  // Within the limits, different from each other, in the order of the starts.
  std::vector<JointPositions> solutions;
  // Why there are none.
  enum class Miss { kNone, kReach, kLimit };
  Miss miss = Miss::kNone;
  // kReach: how near the tip came, by the best start.
  double miss_m = 0, miss_rad = 0;
  // kLimit: the joint that is beyond its limits in the solution that is least so, and its position.
  int limit_joint = -1;
  double limit_position = 0;
};

class InverseKinematics {
 public:
  // `model` must outlive it.
  explicit InverseKinematics(const RobotModel& model);

  // `tip`: in the frame of the base link. Of turns that are the same, a solution has the one next
  // to home within the limits. Solutions are offered to `enough` as they are found; true ends the
  // search. May be called by several threads.
  InverseKinematicsResult Solve(const Eigen::Isometry3d& tip,
                                const std::function<bool(const JointPositions&)>& enough) const;

  // The solution next to `from`, without a jump to another branch, or the nearest it comes to;
  // `reached` says which. Limits are not looked at.
  JointPositions Follow(const Eigen::Isometry3d& tip, const JointPositions& from,
                        bool* reached) const;

 private:
  // Turned by whole turns next to `near` within the limits.
  JointPositions WithoutTurns(JointPositions q, const JointPositions& near) const;
  // How far the tip is from a pose [m, rad].
  std::pair<double, double> Distance(const Eigen::Isometry3d& tip, const JointPositions& q) const;

  const RobotModel& model_;
  KDL::Chain chain_;  // to be copied
  std::vector<JointPositions> starts_;
  double longest_reach_m_ = 0;  // of the tip, from the origin of the first joint
  Eigen::Vector3d first_joint_m_ = Eigen::Vector3d::Zero();  // in the frame of the base link
};

// The n-th number of the Van der Corput sequence of a prime base: evenly spread over [0, 1).
double RadicalInverse(int base, int n);

// Bases of the Halton sequence, one per joint: RadicalInverse(kHaltonBases[j], n) spreads joint
// positions evenly. A robot has at most 16 joints (urdf/robot_model.h).
inline constexpr std::array<int, 16> kHaltonBases = {2,  3,  5,  7,  11, 13, 17, 19,
                                                     23, 29, 31, 37, 41, 43, 47, 53};

}  // namespace sightline
