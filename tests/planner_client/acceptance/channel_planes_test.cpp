// SPDX-License-Identifier: Apache-2.0
#include "planner_client/acceptance/channel_planes.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

// The mosaic is fixed to the principal point, so that crops of 4 n + 2 pixels begin with another
// colour than crops of 4 n.
TEST(ChannelPlanes, FollowTheMosaicAboutThePrincipalPoint) {
  Sensor sensor;
  sensor.colour_filter = ColourFilter::kBayerRggb;
  for (const int columns : {100, 102}) {
    for (const int rows : {60, 62}) {
      const auto red = PlanesOfChannel(sensor, kRed, columns, rows);
      ASSERT_EQ(red.size(), 1U);
      EXPECT_EQ(red[0].first_column, columns / 2 % 2);
      EXPECT_EQ(red[0].first_row, rows / 2 % 2);
      for (const int channel : {kRed, kGreen, kBlue}) {
        for (const ChannelPlane& plane : PlanesOfChannel(sensor, channel, columns, rows)) {
          EXPECT_EQ(plane.step, 2);
          EXPECT_EQ(sensor.ChannelAt(plane.first_row - rows / 2, plane.first_column - columns / 2),
                    channel);
        }
      }
    }
  }
  EXPECT_EQ(PlanesOfChannel(sensor, kGreen, 100, 60).size(), 2U);
}

TEST(ChannelPlanes, OfAMonoSensorAreAllPixels) {
  Sensor sensor;
  sensor.colour_filter = ColourFilter::kMono;
  const auto planes = PlanesOfChannel(sensor, 0, 102, 62);
  ASSERT_EQ(planes.size(), 1U);
  EXPECT_EQ(planes[0].step, 1);
}

}  // namespace
}  // namespace sightline
