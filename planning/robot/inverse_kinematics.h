// SPDX-License-Identifier: Apache-2.0
// Joint positions that bring the tip of a chain to a pose: Levenberg-Marquardt (KDL) from fixed
// starts, so that results are reproducible.
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

// Tolerances within which a pose counts as reached; arms repeat less precisely.
inline constexpr double kPositionToleranceM = 2e-5;
inline constexpr double kAngleToleranceRad = 1e-4;

struct InverseKinematicsResult {
  // Within the limits, different from each other, in the order of the starts.
  std::vector<JointPositions> solutions;
  // Reason why there is no solution.
  enum class Miss { kNone, kReach, kLimit };
  Miss miss = Miss::kNone;
  // kReach: distance of the tip from the pose for the best start.
  double miss_m = 0, miss_rad = 0;
  // kLimit: the joint out of limits, and its position, in the solution that exceeds them
  // least.
  int limit_joint = -1;
  double limit_position = 0;
};

class InverseKinematics {
 public:
  // `model` must outlive it.
  explicit InverseKinematics(const RobotModel& model);

  // `tip`: in the frame of the base link. Among positions that differ by whole turns, a solution
  // has the one nearest to home within the limits. Each solution is passed to `enough`, which ends
  // the search by returning true. Thread-safe.
  InverseKinematicsResult Solve(const Eigen::Isometry3d& tip,
                                const std::function<bool(const JointPositions&)>& enough) const;

  // The solution next to `from` without a jump to another branch (`reached` is then true), or else
  // the nearest pose that can be reached. Joint limits are ignored.
  JointPositions Follow(const Eigen::Isometry3d& tip, const JointPositions& from,
                        bool* reached) const;

 private:
  // Adds whole turns to `q` so that it is next to `near` within the limits.
  JointPositions WithoutTurns(JointPositions q, const JointPositions& near) const;
  // Distance of the tip from a pose [m, rad].
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
