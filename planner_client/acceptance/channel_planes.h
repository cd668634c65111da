// SPDX-License-Identifier: Apache-2.0
// Pixels of one colour in the rendered middle of a sensor.
#pragma once

#include <vector>

#include "core/sensor/sensor.h"

namespace sightline {

// Every `step`-th pixel in both directions, starting at the first ones.
struct ChannelPlane {
  int first_row = 0, first_column = 0, step = 1;
};

// Planes of a channel on the rendered middle of a sensor, `columns_px` times `rows_px`. The colour
// mosaic of rendered images begins at the principal point (Sensor::ChannelAt), so the first pixel
// has the colour at (-rows_px / 2, -columns_px / 2). A mono sensor has one plane of all pixels.
std::vector<ChannelPlane> PlanesOfChannel(const Sensor& sensor, int channel, int columns_px,
                                          int rows_px);

}  // namespace sightline
