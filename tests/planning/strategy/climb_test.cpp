// SPDX-License-Identifier: Apache-2.0
#include "planning/optimise/climb.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace sightline {
namespace {

std::vector<double> Clip(std::span<const double> x) {
  std::vector<double> clipped(x.begin(), x.end());
  for (double& c : clipped) c = std::clamp(c, 0.0, 1.0);
  return clipped;
}

// Maximum 0 at 0.3 in every coordinate.
absl::StatusOr<std::vector<double>> BatchBowl(std::span<const std::vector<double>> points) {
  std::vector<double> values;
  for (const auto& x : points) {
    double sum = 0;
    for (const double c : x) sum -= (c - 0.3) * (c - 0.3);
    values.push_back(sum);
  }
  return values;
}

double ValueAt(const std::vector<double>& x) { return BatchBowl(std::span(&x, 1))->front(); }

TEST(ClimbTest, FindsTheNearbyMaximum) {
  Random random(1);
  const std::vector<double> start = {0.4, 0.5, 0.2};
  const auto climbed = Climb(start, ValueAt(start), 30, BatchBowl, Clip, random);
  ASSERT_TRUE(climbed.ok());
  EXPECT_TRUE(climbed->moved);
  for (const double c : climbed->x) EXPECT_NEAR(c, 0.3, 0.02);
  EXPECT_EQ(climbed->value, ValueAt(climbed->x));
}

TEST(ClimbTest, IsNeverWorseThanItsStartAndStaysAtTheMaximum) {
  Random random(1);
  const std::vector<double> start(9, 0.3);
  const auto climbed = Climb(start, 0, 5, BatchBowl, Clip, random);
  ASSERT_TRUE(climbed.ok());
  EXPECT_EQ(climbed->x, start);
  EXPECT_EQ(climbed->value, 0);
}

TEST(ClimbTest, StaysInTheCubeAndKeepsToItsBatches) {
  Random random(3);
  int batches = 0;
  const BatchObjective upwards =
      [&](std::span<const std::vector<double>> points) -> absl::StatusOr<std::vector<double>> {
    ++batches;
    EXPECT_EQ(points.size(), static_cast<size_t>(kClimbBatch));
    std::vector<double> values;
    for (const auto& x : points) {
      EXPECT_GE(x[0], 0);
      EXPECT_LE(x[0], 1);
      values.push_back(x[0]);
    }
    return values;
  };
  const auto climbed = Climb({0.9}, 0.9, 7, upwards, Clip, random);
  ASSERT_TRUE(climbed.ok());
  EXPECT_EQ(climbed->x[0], 1);
  EXPECT_EQ(batches, 7);
}

TEST(ClimbTest, PassesOnErrors) {
  Random random(1);
  const BatchObjective fails = [](std::span<const std::vector<double>>) {
    return absl::StatusOr<std::vector<double>>(absl::CancelledError("stop"));
  };
  EXPECT_EQ(Climb({0.5}, 0, 1, fails, Clip, random).status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace sightline
