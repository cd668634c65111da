// SPDX-License-Identifier: Apache-2.0
#include "planning/pareto/frame_estimate.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

// The upper face of a plate of 0.2 m by 0.1 m about the origin, a target every 5 mm.
TargetSet Plate() {
  TargetSet targets;
  for (int i = -20; i <= 20; ++i) {
    for (int j = -10; j <= 10; ++j) {
      targets.positions_m.emplace_back(0.005f * static_cast<float>(i),
                                       0.005f * static_cast<float>(j), 0.0f);
      targets.normals.emplace_back(0.0f, 0.0f, 1.0f);
    }
  }
  return targets;
}

// Camera straight above, laser 30 degrees beside: at the height of the origin the sheet stands at
// x = 0 and the stage travels the length of the plate.
Measurement FromAbove() {
  Measurement scan;
  scan.camera_distance_m = 0.4;
  scan.triangulation_angle_rad = 0.5;
  return scan;
}

TEST(FrameEstimateTest, TravelsTheLengthOfThePart) {
  const FrameEstimate estimate(Rig{}, Eigen::Vector3d::Zero(), Plate());
  const FrameRange range = estimate.Frames(FromAbove());
  EXPECT_NEAR(range.first, -100, 1);
  EXPECT_NEAR(range.last, 100, 1);
}

TEST(FrameEstimateTest, ATurnedPartIsShorter) {
  const FrameEstimate estimate(Rig{}, Eigen::Vector3d::Zero(), Plate());
  Measurement turned = FromAbove();
  turned.part_gamma_rad = std::acos(0.0);
  const FrameRange range = estimate.Frames(turned);
  EXPECT_NEAR(range.last - range.first, 100, 2);
}

TEST(FrameEstimateTest, ASampleOfTheTargetsGivesNearlyTheSame) {
  const FrameEstimate all(Rig{}, Eigen::Vector3d::Zero(), Plate()),
      some(Rig{}, Eigen::Vector3d::Zero(), Plate(), 100);
  EXPECT_NEAR(all.Frames(FromAbove()).last, some.Frames(FromAbove()).last, 12);
}

TEST(FrameEstimateTest, WhatFacesAwayOrLiesOutOfViewYieldsNoFrames) {
  const FrameEstimate estimate(Rig{}, Eigen::Vector3d::Zero(), Plate());
  Measurement below = FromAbove();
  below.part_alpha_rad = 2 * std::acos(0.0);
  FrameRange range = estimate.Frames(below);
  EXPECT_LT(range.last, range.first);
  Measurement beside = FromAbove();
  beside.offset_y_m = 2;
  range = estimate.Frames(beside);
  EXPECT_LT(range.last, range.first);
  range = FrameEstimate(Rig{}, Eigen::Vector3d::Zero(), TargetSet{}).Frames(FromAbove());
  EXPECT_LT(range.last, range.first);
}

}  // namespace
}  // namespace sightline
