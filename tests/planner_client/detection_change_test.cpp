// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/detection_change.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace sightline {
namespace {

v1::LearnedDetection Learned(double scale, double error) {
  v1::LearnedDetection learned;
  v1::LineDetection::Table* table = learned.mutable_table();
  for (const double distance : {0.4, 0.6}) table->add_distances_m(distance);
  for (const double angle : {10.0, 40.0, 70.0}) table->add_incidence_angles_deg(angle);
  for (const double u : {0.10, 0.12, 0.20, 0.15, 0.18, 0.30}) {
    table->add_standard_deviations_px(scale * u);
    learned.add_relative_standard_errors(error);
  }
  return learned;
}

TEST(DetectionChange, NoneFromATableToItself) {
  const auto noise = NoiseOf(Learned(1, 0.05));
  ASSERT_TRUE(noise.ok());
  const DetectionChange change = ChangeOf(*noise, 0.05, Learned(1, 0.05));
  EXPECT_NEAR(change.root_mean_square, 0, 1e-12);
  EXPECT_NEAR(change.in_standard_errors, 0, 1e-12);
  EXPECT_TRUE(change.IsNone());
}

TEST(DetectionChange, IsThatOfTheLogarithmWhicheverTheWay) {
  const auto noise = NoiseOf(Learned(1, 0.05));
  ASSERT_TRUE(noise.ok());
  for (const double scale : {1.5, 1 / 1.5}) {
    const DetectionChange change = ChangeOf(*noise, 0, Learned(scale, 0.05));
    EXPECT_NEAR(change.root_mean_square, std::log(1.5), 1e-12);
    EXPECT_NEAR(change.in_standard_errors, std::log(1.5) / 0.05, 1e-9);
    EXPECT_FALSE(change.IsNone());
  }
}

TEST(DetectionChange, CountsTheErrorsOfBothTables) {
  const auto noise = NoiseOf(Learned(1, 0.03));
  ASSERT_TRUE(noise.ok());
  const v1::LearnedDetection later = Learned(1.1, 0.04);
  EXPECT_NEAR(MeanError(later), 0.04, 1e-12);
  EXPECT_NEAR(ChangeOf(*noise, 0.03, later).in_standard_errors, std::log(1.1) / 0.05, 1e-9);
}

// A hundredth of u moves no scan, however well it is known.
TEST(DetectionChange, SmallOnesAreNone) {
  const auto noise = NoiseOf(Learned(1, 1e-6));
  ASSERT_TRUE(noise.ok());
  EXPECT_TRUE(ChangeOf(*noise, 0, Learned(1.005, 1e-6)).IsNone());
  EXPECT_FALSE(ChangeOf(*noise, 0, Learned(1.05, 1e-6)).IsNone());
}

TEST(DetectionChange, ComparedWithAStatedConstant) {
  LineDetectionNoise stated;
  stated.standard_deviations_px = {0.15};
  const DetectionChange change = ChangeOf(stated, 0, Learned(1, 0.05));
  EXPECT_GT(change.root_mean_square, 0.3);
}

TEST(DetectionChange, ATableThatIsNoneIsRefused) {
  v1::LearnedDetection learned = Learned(1, 0.05);
  learned.mutable_table()->set_standard_deviations_px(2, std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(NoiseOf(learned).status().code(), absl::StatusCode::kInvalidArgument);
  learned = Learned(1, 0.05);
  learned.mutable_table()->mutable_standard_deviations_px()->RemoveLast();
  EXPECT_EQ(NoiseOf(learned).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sightline
