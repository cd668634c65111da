// SPDX-License-Identifier: Apache-2.0
#include "planner_client/acceptance/channel_planes.h"

namespace sightline {

std::vector<ChannelPlane> PlanesOfChannel(const Sensor& sensor, int channel, int columns_px,
                                          int rows_px) {
  if (sensor.colour_filter == ColourFilter::kMono) return {ChannelPlane{}};
  std::vector<ChannelPlane> planes;
  for (const int row : {0, 1}) {
    for (const int column : {0, 1}) {
      if (sensor.ChannelAt(row - rows_px / 2, column - columns_px / 2) == channel) {
        planes.push_back({row, column, 2});
      }
    }
  }
  return planes;
}

}  // namespace sightline
