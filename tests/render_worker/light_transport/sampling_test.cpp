// SPDX-License-Identifier: Apache-2.0
#include "render_worker/light_transport/sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

namespace sightline {
namespace {

TEST(PixelSamples, EveryDimensionIsStratifiedWithinAPixel) {
  PixelSamples samples(7, 130, 900, 6);
  std::set<int> cells[12];
  for (int s = 0; s < 64; ++s) {
    samples.Start(s);
    for (int group = 0; group < 3; ++group) {
      const auto u = samples.Next();
      for (int d = 0; d < 4; ++d) {
        ASSERT_GE(u[d], 0);
        ASSERT_LT(u[d], 1);
        cells[4 * group + d].insert(static_cast<int>(u[d] * 64));
      }
    }
  }
  for (const auto& c : cells) EXPECT_EQ(c.size(), 64u);
}

TEST(PixelSamples, FirstTwoDimensionsAreATwoDimensionalNet) {
  PixelSamples samples(3, 5, 6, 6);
  std::set<int> cells;
  for (int s = 0; s < 64; ++s) {
    samples.Start(s);
    const auto u = samples.Next();
    cells.insert(static_cast<int>(u[0] * 8) * 8 + static_cast<int>(u[1] * 8));
  }
  EXPECT_EQ(cells.size(), 64u);
}

TEST(PixelSamples, BlocksOfPixelsShareOneNet) {
  // 4 x 4 pixels of 4 samples: each 64th of the unit interval once.
  std::set<int> cells;
  for (int y = 8; y < 12; ++y) {
    for (int x = 16; x < 20; ++x) {
      PixelSamples samples(11, x, y, 2);
      for (int s = 0; s < 4; ++s) {
        samples.Start(s);
        samples.Next();
        cells.insert(static_cast<int>(samples.Next()[2] * 64));
      }
    }
  }
  EXPECT_EQ(cells.size(), 64u);
}

TEST(PixelSamples, GroupsOfDimensionsAreUncorrelated) {
  // Correlation of dimensions 0 and 4 over 4096 pixels' first samples: standard error 1/64.
  double sum = 0;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      PixelSamples samples(5, x, y, 0);
      samples.Start(0);
      const auto a = samples.Next(), b = samples.Next();
      sum += (a[0] - 0.5) * (b[0] - 0.5) * 12;
    }
  }
  EXPECT_LT(std::abs(sum / 4096), 4.0 / 64);
}

}  // namespace
}  // namespace sightline
