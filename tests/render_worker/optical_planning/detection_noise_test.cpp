// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/detection_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace sightline {
namespace {

constexpr double kDegree = 0.017453292519943295;

// u in pixels and share found, as functions of distance [m] and angle [rad].
double DeviationAt(double distance_m, double angle_rad) {
  return 0.15 * std::exp(1.5 * (distance_m - 0.5) + 0.6 * angle_rad);
}
double ShareAt(double distance_m, double angle_rad) {
  return 1 / (1 + std::exp(-(3 - 4 * (distance_m - 0.5) - 1.5 * angle_rad)));
}

// `shared`: part of the variance of ln sigma^2 that all columns of a block have in common.
std::vector<DetectedBlock> DrawBlocks(int count, double shared, double bias_px, unsigned seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> distance(0.4, 0.7), angle(5 * kDegree, 70 * kDegree),
      uniform(0, 1);
  std::normal_distribution<double> normal;
  std::vector<DetectedBlock> blocks;
  for (int b = 0; b < count; ++b) {
    DetectedBlock block{.distance_m = distance(random), .incidence_rad = angle(random)};
    const double sigma = DeviationAt(block.distance_m, block.incidence_rad) *
                         std::exp(shared * normal(random) - shared * shared);
    for (int column = 0; column < 64; ++column) {
      block.crossings += 1;
      if (uniform(random) > ShareAt(block.distance_m, block.incidence_rad)) continue;
      const double deviation = bias_px + sigma * normal(random);
      block.found += 1;
      block.deviation_px += deviation;
      block.deviation2_px2 += deviation * deviation;
    }
    blocks.push_back(block);
  }
  return blocks;
}

// Entries of the table within `errors` standard errors of the truth, as a share of all.
double ShareWithin(const DetectionNoise& noise, double errors) {
  int within = 0, entries = 0;
  for (const double d : noise.distances_m) {
    for (const double a : noise.incidence_angles_rad) {
      const double truth = DeviationAt(d, a) / std::sqrt(ShareAt(d, a));
      const double off = std::log(noise.u_px[static_cast<size_t>(entries)] / truth);
      within +=
          std::abs(off) <= errors * noise.relative_standard_error[static_cast<size_t>(entries)];
      ++entries;
    }
  }
  return static_cast<double>(within) / entries;
}

TEST(DetectionNoise, FindsTheLawWithinItsErrors) {
  double covered = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto noise = LearnDetectionNoise(DrawBlocks(400, 0, 0, seed));
    ASSERT_TRUE(noise.has_value());
    EXPECT_EQ(noise->u_px.size(), noise->distances_m.size() * noise->incidence_angles_rad.size());
    covered += ShareWithin(*noise, 2) / 20;
    for (const double error : noise->relative_standard_error) EXPECT_LT(error, 0.2);
  }
  EXPECT_GT(covered, 0.88);
}

TEST(DetectionNoise, ErrorsGrowWithWhatColumnsOfABlockShare) {
  double covered = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto alone = LearnDetectionNoise(DrawBlocks(400, 0, 0, seed));
    const auto noise = LearnDetectionNoise(DrawBlocks(400, 0.3, 0, seed));
    ASSERT_TRUE(alone && noise);
    EXPECT_LT(alone->deviation_dispersion, 1.5);
    EXPECT_GT(noise->deviation_dispersion, 3);
    EXPECT_GT(noise->relative_standard_error[0], 1.3 * alone->relative_standard_error[0]);
    covered += ShareWithin(*noise, 2) / 20;
  }
  EXPECT_GT(covered, 0.85);
}

TEST(DetectionNoise, LeavesOutWhatAllPointsHaveInCommon) {
  const auto without = LearnDetectionNoise(DrawBlocks(200, 0, 0, 3));
  const auto with = LearnDetectionNoise(DrawBlocks(200, 0, 0.4, 3));
  ASSERT_TRUE(without && with);
  EXPECT_NEAR(with->bias_px - without->bias_px, 0.4, 1e-12);
  for (size_t i = 0; i < with->u_px.size(); ++i) {
    EXPECT_NEAR(with->u_px[i], without->u_px[i], 1e-6 * without->u_px[i]);
  }
}

// Twice the pixels: the same shares, twice the deviations.
TEST(DetectionNoise, ScalesWithTheDeviations) {
  std::vector<DetectedBlock> blocks = DrawBlocks(300, 0.1, 0, 5);
  const auto one = LearnDetectionNoise(blocks);
  for (DetectedBlock& block : blocks) {
    block.deviation_px *= 2;
    block.deviation2_px2 *= 4;
  }
  const auto two = LearnDetectionNoise(blocks);
  ASSERT_TRUE(one && two);
  for (size_t i = 0; i < one->u_px.size(); ++i) {
    EXPECT_NEAR(two->u_px[i], 2 * one->u_px[i], 1e-3 * one->u_px[i]);
  }
}

TEST(DetectionNoise, BlocksThatAreAllAlikeGiveOneNumber) {
  std::vector<DetectedBlock> blocks;
  for (int b = 0; b < 20; ++b) {
    blocks.push_back({.distance_m = 0.5,
                      .incidence_rad = 0.3,
                      .crossings = 40,
                      .found = 30,
                      .deviation_px = 0,
                      .deviation2_px2 = 30 * 0.04});
  }
  const auto noise = LearnDetectionNoise(blocks);
  ASSERT_TRUE(noise.has_value());
  ASSERT_EQ(noise->u_px.size(), 1U);
  EXPECT_NEAR(noise->u_px[0], 0.2 / std::sqrt(0.75), 1e-3);
}

TEST(DetectionNoise, AllFoundIsNoTrouble) {
  std::vector<DetectedBlock> blocks = DrawBlocks(100, 0, 0, 7);
  for (DetectedBlock& block : blocks) block.crossings = block.found;
  const auto noise = LearnDetectionNoise(blocks);
  ASSERT_TRUE(noise.has_value());
  for (const double u : noise->u_px) EXPECT_TRUE(std::isfinite(u) && u > 0);
  for (const double error : noise->relative_standard_error) {
    EXPECT_TRUE(std::isfinite(error) && error < 1);
  }
}

// Lines of three views along a diagonal of the grid, ever worse found: in its corners there is
// nothing to go by, and no number there may be one that an inspection does not take.
TEST(DetectionNoise, CornersWithoutBlocksStayWithinWhatATableStates) {
  std::vector<DetectedBlock> blocks;
  for (int i = 0; i < 30; ++i) {
    const double part = i / 29.0;
    DetectedBlock block{.distance_m = 0.4 + 0.3 * part, .incidence_rad = 1.2 * part};
    block.crossings = 2000;
    block.found = std::max(2.0, 2000 * std::exp(-9 * part));
    const double sigma_px = 0.1 * std::exp(5 * part);
    block.deviation2_px2 = block.found * sigma_px * sigma_px;
    blocks.push_back(block);
  }
  const auto noise = LearnDetectionNoise(blocks);
  ASSERT_TRUE(noise.has_value());
  double largest_px = 0;
  for (const double u_px : noise->u_px) {
    EXPECT_GT(u_px, 0);
    largest_px = std::max(largest_px, u_px);
  }
  EXPECT_EQ(largest_px, 100);
}

TEST(DetectionNoise, TooFewPointsTellNothing) {
  EXPECT_FALSE(LearnDetectionNoise({}).has_value());
  EXPECT_FALSE(LearnDetectionNoise(DrawBlocks(1, 0, 0, 1)).has_value());
  std::vector<DetectedBlock> none(50, {.distance_m = 0.5, .incidence_rad = 0.2, .crossings = 64});
  EXPECT_FALSE(LearnDetectionNoise(none).has_value());
}

}  // namespace
}  // namespace sightline
