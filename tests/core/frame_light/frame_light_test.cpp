// SPDX-License-Identifier: Apache-2.0
#include "core/frame_light/frame_light.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace sightline {
namespace {

using testing::Contains;
using testing::HasSubstr;

constexpr int kColumnsPx = 256, kRowsPx = 320;

LineInFrame StraightLine() {
  LineInFrame line;
  for (int row = 4; row < kRowsPx; row += 8) {
    line.samples.push_back({Eigen::Vector2d(100, row), static_cast<double>(row)});
  }
  line.clipped_fraction = 1;
  return line;
}

// Paper of 20 DN and a halo of 60 DN mm over the distance; print shows `print_part` of both. The
// light beside the line is twice as strong at the end of the image.
FrameTiles Tiles(double print_part, double frame_factor) {
  FrameTiles tiles;
  for (int i = 0; i < 200; ++i) {
    BoardTile tile;
    tile.print = i % 2 == 1;
    tile.from_line_m = 0.002 * std::pow(20, i / 199.0);
    const double light = frame_factor * (20 + 0.06 / tile.from_line_m);
    tile.raw_dn = tile.print ? print_part * light : light;
    tile.variance_dn2 = 1.0 / 12 + 0.02 * tile.raw_dn;
    tiles.tiles.push_back(tile);
  }
  for (const LineSample& sample : StraightLine().samples) {
    tiles.sides.push_back({sample.image_px, 40 + 40 * sample.image_px.y() / kRowsPx});
  }
  return tiles;
}

FrameLight LightOf(double print_part) {
  FrameLightSums sums;
  Image<uint16_t> image(kColumnsPx, kRowsPx);
  for (int row = 64; row < 96; ++row) {
    for (int column = 224; column < 256; ++column) image.At(row, column) = 255;
  }
  for (int frame = 0; frame < 6; ++frame) {
    sums.Add(image, 255, StraightLine(), Tiles(print_part, 1 + 0.02 * frame));
  }
  return sums.Result();
}

TEST(FrameLight, TellsAHaloOnTheBoardFromOneInTheLens) {
  const FrameLight board = LightOf(0.2);
  EXPECT_NEAR(board.print_over_paper, 0.2, 0.02);
  EXPECT_THAT(LightFindings(board), Contains(HasSubstr("Halo on the board")));
  EXPECT_THAT(LightFindings(LightOf(1)), Contains(HasSubstr("Halo in lens or sensor")));
}

TEST(FrameLight, FindsWhatMovesWithTheScanner) {
  const FrameLight light = LightOf(0.2);
  EXPECT_GT(light.along_line_correlation, 0.99);
  EXPECT_THAT(LightFindings(light), Contains(HasSubstr("at the same places of the image")));
  ASSERT_EQ(light.bright.size(), 1u);
  EXPECT_EQ(light.bright[0].image_px, Eigen::Vector2d(240, 80));
  EXPECT_EQ(light.bright[0].frame_count, 6);
}

TEST(FrameLight, ShotNoiseOfLinearNumbersIsNearerToLinear) {
  const FrameLight light = LightOf(0.2);
  EXPECT_NEAR(light.noise_exponent, 1, 0.01);
  EXPECT_THAT(NotDetermined(light), Contains(HasSubstr("nearer to linear")));
  EXPECT_THAT(NotDetermined(light), Contains(HasSubstr("clipped in 100 %")));
}

TEST(FrameLight, FewFramesSayNothing) {
  const FrameLight light = FrameLightSums().Result();
  EXPECT_EQ(light.frame_count, 0);
  EXPECT_TRUE(LightFindings(light).empty());
  EXPECT_EQ(NotDetermined(light).size(), 1u);
}

}  // namespace
}  // namespace sightline
