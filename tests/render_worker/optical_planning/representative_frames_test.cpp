// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/representative_frames.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

namespace sightline {
namespace {

FrameGlance Glance(int lit, double log_radiance, double depth_m) {
  FrameGlance glance;
  glance.lit_samples = lit;
  glance.mean_log_radiance = log_radiance;
  glance.mean_depth_m = depth_m;
  return glance;
}

// Three kinds of frames: one of each is chosen, and stands for its share of the line.
TEST(Representatives, StandForTheirKind) {
  std::mt19937 random(4);
  std::normal_distribution<double> noise(0, 0.01);
  std::vector<FrameGlance> glances;
  for (int i = 0; i < 60; ++i) {
    const int kind = i < 30 ? 0 : i < 50 ? 1 : 2;
    glances.push_back(Glance(100, kind + noise(random), 0.3 + 0.05 * kind + 0.001 * noise(random)));
  }
  const Representatives chosen = ChooseRepresentatives(glances, 3);
  ASSERT_EQ(chosen.frames.size(), 3U);
  double sum = 0;
  std::set<int> kinds;
  for (const auto& frame : chosen.frames) {
    sum += frame.weight;
    kinds.insert(frame.index < 30 ? 0 : frame.index < 50 ? 1 : 2);
  }
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_EQ(kinds.size(), 3U);
  EXPECT_NEAR(chosen.frames[0].weight, 0.5, 1e-9);
  EXPECT_GT(chosen.represented_fraction, 0.95);
  for (const auto& frame : chosen.frames) EXPECT_NE(frame.index, chosen.farthest);
  EXPECT_GE(chosen.farthest, 0);
}

TEST(Representatives, MoreFramesRepresentMore) {
  std::mt19937 random(9);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::vector<FrameGlance> glances;
  for (int i = 0; i < 40; ++i) {
    glances.push_back(Glance(50 + static_cast<int>(100 * uniform(random)), uniform(random),
                             0.3 + 0.1 * uniform(random)));
  }
  double before = -1;
  for (const int count : {1, 2, 4, 8, 40}) {
    const Representatives chosen = ChooseRepresentatives(glances, count);
    EXPECT_GE(chosen.represented_fraction, before - 0.05) << count;
    before = chosen.represented_fraction;
  }
  EXPECT_NEAR(before, 1, 1e-9);
}

TEST(Representatives, DarkFramesStandForNothing) {
  std::vector<FrameGlance> glances = {Glance(0, 0, 0), Glance(10, 1, 0.3), Glance(0, 0, 0)};
  const Representatives chosen = ChooseRepresentatives(glances, 3);
  ASSERT_EQ(chosen.frames.size(), 1U);
  EXPECT_EQ(chosen.frames[0].index, 1);
  EXPECT_TRUE(ChooseRepresentatives({Glance(0, 0, 0)}, 2).frames.empty());
}

}  // namespace
}  // namespace sightline
