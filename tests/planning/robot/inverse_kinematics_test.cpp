// SPDX-License-Identifier: Apache-2.0
#include "planning/robot/inverse_kinematics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/random/random.h"
#include "tests/planning/robot/robot_files.h"

namespace sightline {
namespace {

using Miss = InverseKinematicsResult::Miss;

class InverseKinematicsTest : public RobotFilesTest {};

const auto kAll = [](const JointPositions&) { return false; };

// For any position of an arm, the solver finds its pose again, by solutions within the limits that
// have that very pose; nearly always the position itself is among them.
TEST_F(InverseKinematicsTest, FindsPosesOfTheArmAgain) {
  const auto model = ReadRobotModel(ArmMount());
  ASSERT_TRUE(model.ok()) << model.status();
  const InverseKinematics kinematics(*model);
  Random random(3);
  int itself = 0;
  constexpr int kTrials = 200;
  for (int n = 0; n < kTrials; ++n) {
    JointPositions q;
    for (int j = 0; j < 6; ++j) q.push_back(std::numbers::pi * (2 * random.Uniform() - 1));
    const Eigen::Isometry3d pose = model->LinkPoses(q)[model->tip];
    const InverseKinematicsResult result = kinematics.Solve(pose, kAll);
    ASSERT_FALSE(result.solutions.empty()) << n;
    EXPECT_EQ(result.miss, Miss::kNone);
    bool found = false;
    for (const JointPositions& solution : result.solutions) {
      const Eigen::Isometry3d tip = model->LinkPoses(solution)[model->tip];
      EXPECT_LT((tip.translation() - pose.translation()).norm(), kPositionToleranceM);
      EXPECT_LT(Eigen::AngleAxisd(tip.linear().transpose() * pose.linear()).angle(),
                kAngleToleranceRad);
      bool same = true;
      for (size_t j = 0; j < 6; ++j) {
        EXPECT_GE(solution[j], model->joints[j].min);
        EXPECT_LE(solution[j], model->joints[j].max);
        same &= std::abs(std::remainder(solution[j] - q[j], 2 * std::numbers::pi)) < 0.01;
      }
      found |= same;
    }
    itself += found;
    // The same every time: some poses show that.
    if (n % 10 == 0) {
      EXPECT_EQ(kinematics.Solve(pose, kAll).solutions, result.solutions);
    }
  }
  EXPECT_GE(itself, kTrials * 8 / 10);
}

TEST_F(InverseKinematicsTest, StopsWhereEnoughIsFound) {
  const auto model = ReadRobotModel(ArmMount());
  ASSERT_TRUE(model.ok()) << model.status();
  const Eigen::Isometry3d pose = model->LinkPoses({0.3, -1.1, 1.4, -0.7, 0.9, 0.2})[model->tip];
  const InverseKinematics kinematics(*model);
  EXPECT_GE(kinematics.Solve(pose, kAll).solutions.size(), 4u);
  EXPECT_EQ(kinematics.Solve(pose, [](const JointPositions&) { return true; }).solutions.size(),
            1u);
}

TEST_F(InverseKinematicsTest, SaysWhatHinders) {
  RobotMount mount;
  mount.urdf_file = Write("arm.urdf", PlanarArm(R"(lower="-1" upper="1")"));
  mount.tip_link = "tip";
  const auto model = ReadRobotModel(mount);
  ASSERT_TRUE(model.ok()) << model.status();
  const InverseKinematics kinematics(*model);
  // 0.5 m and 0.4 m reach 0.9 m.
  Eigen::Isometry3d far = Eigen::Isometry3d::Identity();
  far.translation() = Eigen::Vector3d(1.2, 0, 0);
  InverseKinematicsResult result = kinematics.Solve(far, kAll);
  EXPECT_EQ(result.miss, Miss::kReach);
  EXPECT_NEAR(result.miss_m, 0.3, 1e-9);
  // Above the plane it moves in, near.
  Eigen::Isometry3d above = model->LinkPoses({0.2, 0.4})[model->tip];
  above.pretranslate(Eigen::Vector3d(0, 0, 0.05));
  result = kinematics.Solve(above, kAll);
  EXPECT_EQ(result.miss, Miss::kReach);
  EXPECT_NEAR(result.miss_m, 0.05, 0.02);
  // The elbow would have to be at 1.5 rad.
  result = kinematics.Solve(model->LinkPoses({0.2, 1.5})[model->tip], kAll);
  EXPECT_TRUE(result.solutions.empty());
  EXPECT_EQ(result.miss, Miss::kLimit);
  EXPECT_EQ(result.limit_joint, 1);
  EXPECT_NEAR(result.limit_position, 1.5, 1e-3);
}

TEST_F(InverseKinematicsTest, FollowsTheBranchItIsOn) {
  const auto model = ReadRobotModel(ArmMount());
  ASSERT_TRUE(model.ok()) << model.status();
  const InverseKinematics kinematics(*model);
  const JointPositions start = {-1.5, -1.4, 1.5, -1.6, -1.5, 0.1};
  Eigen::Isometry3d pose = model->LinkPoses(start)[model->tip];
  JointPositions q = start;
  for (int k = 0; k < 20; ++k) {
    pose.pretranslate(Eigen::Vector3d(0.01, 0, 0));
    bool reached = false;
    const JointPositions before = q;
    q = kinematics.Follow(pose, before, &reached);
    ASSERT_TRUE(reached) << k;
    for (size_t j = 0; j < 6; ++j) EXPECT_LT(std::abs(q[j] - before[j]), 0.1);
  }
  pose.pretranslate(Eigen::Vector3d(5, 0, 0));
  bool reached = true;
  kinematics.Follow(pose, q, &reached);
  EXPECT_FALSE(reached);
}

}  // namespace
}  // namespace sightline
