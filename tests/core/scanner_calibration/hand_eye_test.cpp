// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/hand_eye.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "core/scanner_calibration/target_camera.h"

namespace sightline {
namespace {

using testing::HasSubstr;

struct RobotPoses {
  std::vector<Eigen::Isometry3d> flange, target;
  std::vector<std::string> names;
  Eigen::VectorXd hand_eye;
};

// Poses with errors of 0.3 mm and 0.5 mrad of the robot.
RobotPoses MakeRobotPoses(uint32_t seed, int count = 10) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::normal_distribution<double> normal;
  const auto six = [&](double turn, double shift, auto& distribution) {
    Eigen::VectorXd v(6);
    for (int i = 0; i < 6; ++i) v[i] = (i < 3 ? turn : shift) * distribution(random);
    return v;
  };
  RobotPoses poses;
  poses.hand_eye.resize(6);
  poses.hand_eye << 0.1, -1.2, 0.4, 0.05, -0.02, 0.11;
  Eigen::VectorXd base(6);
  base << 0.2, 0.1, 1.9, 1.3, 0.1, 0.4;
  const Eigen::Isometry3d target_in_base = MotionOf(base);
  for (int k = 0; k < count; ++k) {
    Eigen::VectorXd seen = six(0.5, 0.03, uniform);
    seen[5] += 0.3;
    poses.target.push_back(MotionOf(seen));
    poses.flange.push_back(target_in_base * MotionOf(six(5e-4, 3e-4, normal)) *
                           poses.target.back().inverse() * MotionOf(poses.hand_eye).inverse());
    poses.names.push_back("frame" + std::to_string(k + 1));
  }
  return poses;
}

std::string WhyNot(const RobotPoses& poses) {
  const auto found = FindHandEye(poses.flange, poses.target);
  return WhyPosesDoNotFit(poses.flange, poses.target, poses.names,
                          found.ok() ? found->closure_m : 1);
}

// chi^2 / 6 over 60 seeds has a standard deviation of 0.08; its covariance is estimated from 60
// residuals, which adds a little.
TEST(HandEye, ErrsAsItsCovarianceSays) {
  double mean = 0;
  constexpr int kSeeds = 60;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const RobotPoses poses = MakeRobotPoses(static_cast<uint32_t>(seed));
    const auto found = FindHandEye(poses.flange, poses.target);
    ASSERT_TRUE(found.ok()) << found.status();
    const Eigen::VectorXd off = found->camera_in_flange - poses.hand_eye;
    mean += off.dot(found->covariance.ldlt().solve(off)) / 6 / kSeeds;
    EXPECT_LT(found->closure_m, 1.5e-3);
  }
  EXPECT_GT(mean, 0.6);
  EXPECT_LT(mean, 1.5);
}

// (s - 1) / standard error over 40 seeds: its mean square has a standard deviation of 0.22.
TEST(ScaleByRobot, FindsSquaresThatAreOnePerCentTooLong) {
  double mean = 0;
  constexpr int kSeeds = 40;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    RobotPoses poses = MakeRobotPoses(static_cast<uint32_t>(seed), 16);
    for (Eigen::Isometry3d& motion : poses.target) motion.translation() *= 1.01;
    const auto scale = ScaleByRobot(poses.flange, poses.target);
    ASSERT_TRUE(scale.ok()) << scale.status();
    mean += std::pow((scale->value - 1 / 1.01) / scale->standard_error, 2) / kSeeds;
    EXPECT_LT(scale->standard_error, 0.005);
  }
  EXPECT_GT(mean, 0.4);
  EXPECT_LT(mean, 1.8);
}

TEST(HandEye, NeedsThreeFramesAndTwoAxes) {
  RobotPoses poses = MakeRobotPoses(1, 2);
  EXPECT_THAT(std::string(FindHandEye(poses.flange, poses.target).status().message()),
              HasSubstr("three frames"));
  poses = MakeRobotPoses(1);
  for (size_t k = 0; k < poses.flange.size(); ++k) {
    poses.flange[k] = Eigen::AngleAxisd(0.1 * static_cast<double>(k), Eigen::Vector3d::UnitZ());
    poses.target[k] = poses.flange[k].inverse() * Eigen::Translation3d(0, 0, 0.3);
  }
  EXPECT_THAT(std::string(FindHandEye(poses.flange, poses.target).status().message()),
              HasSubstr("two axes"));
}

TEST(HandEye, NamesTheMistakeInThePoses) {
  const RobotPoses right = MakeRobotPoses(2);
  EXPECT_EQ(WhyNot(right), "");
  RobotPoses wrong = right;
  std::swap(wrong.flange[2], wrong.flange[6]);
  EXPECT_THAT(WhyNot(wrong), HasSubstr("frame3 and frame7 are exchanged"));
  wrong = right;
  std::reverse(wrong.flange.begin(), wrong.flange.end());
  EXPECT_THAT(WhyNot(wrong), HasSubstr("reverse order"));
  wrong = right;
  std::rotate(wrong.flange.begin(), wrong.flange.begin() + 1, wrong.flange.end());
  EXPECT_THAT(WhyNot(wrong), HasSubstr("each pose fits the frame after its own"));
  std::rotate(wrong.flange.rbegin(), wrong.flange.rbegin() + 2, wrong.flange.rend());
  EXPECT_THAT(WhyNot(wrong), HasSubstr("each pose fits the frame before its own"));
  wrong = right;
  for (Eigen::Isometry3d& motion : wrong.flange) motion = motion.inverse();
  EXPECT_THAT(WhyNot(wrong), HasSubstr("inverse"));
}

TEST(HandEye, NamesMirroredImagesAndWrongSquares) {
  RobotPoses wrong = MakeRobotPoses(3);
  const Eigen::Vector3d flip(-1, 1, 1);
  for (Eigen::Isometry3d& motion : wrong.target) {
    motion.linear() = (flip.asDiagonal() * motion.linear() * flip.asDiagonal()).eval();
    motion.translation() = flip.asDiagonal() * motion.translation();
  }
  EXPECT_THAT(WhyNot(wrong), HasSubstr("mirrored"));
  wrong = MakeRobotPoses(3);
  for (Eigen::Isometry3d& motion : wrong.target) motion.translation() *= 10;
  EXPECT_THAT(WhyNot(wrong), HasSubstr("square_m is 0.1 times"));
}

}  // namespace
}  // namespace sightline
