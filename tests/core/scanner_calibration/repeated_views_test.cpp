// SPDX-License-Identifier: Apache-2.0
#include "core/scanner_calibration/repeated_views.h"

#include <gtest/gtest.h>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

using Corners = std::vector<Eigen::Vector2d>;

Corners View(double shift_px, double scatter_px, uint64_t seed) {
  CounterRandom random(seed, 0);
  Corners corners;
  for (int i = 0; i < 48; ++i) {
    corners.emplace_back(60 * (i % 8) + shift_px + scatter_px * random.Normal(),
                         60 * (i / 8) + scatter_px * random.Normal());
  }
  return corners;
}

TEST(RepeatedViews, AreThoseWithCornersInTheSamePlaces) {
  // Three views, each three times with the scatter of corners.
  std::vector<Corners> views;
  for (uint64_t i = 0; i < 9; ++i) views.push_back(View(20.0 * static_cast<double>(i % 3), 0.5, i));
  const auto repeated = FindRepeatedViews(views);
  for (size_t i = 0; i < 3; ++i) EXPECT_FALSE(repeated[i].has_value()) << i;
  for (size_t i = 3; i < 9; ++i) {
    ASSERT_TRUE(repeated[i].has_value()) << i;
    EXPECT_EQ(repeated[i]->of, i % 3);
    EXPECT_LT(repeated[i]->corners_rms_px, kSameView_px);
  }
}

TEST(RepeatedViews, NeedAsManyCornersAndSome) {
  const Corners all = View(0, 0, 1);
  const Corners fewer(all.begin(), all.end() - 1);
  const auto repeated = FindRepeatedViews({all, fewer, {}, {}, View(4, 0, 1)});
  for (const auto& view : repeated) EXPECT_FALSE(view.has_value());
}

}  // namespace
}  // namespace sightline
