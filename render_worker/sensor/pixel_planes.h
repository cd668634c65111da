// SPDX-License-Identifier: Apache-2.0
// The interleaved planes of a sensor's image; each contains the pixels of one colour.
#pragma once

#include <vector>

#include "core/image/image.h"
#include "core/sensor/sensor.h"

namespace sightline {

// Pixels of one kind: all pixels of a mono sensor, or one of the four of a Bayer cell.
struct PixelPlane {
  int first_row = 0;
  int first_column = 0;
  int step = 1;
};

// The planes of a sensor, row by row of the cell.
std::vector<PixelPlane> PixelPlanes(const Sensor& sensor);

// Pixels of a plane as a dense image.
Image<float> PlaneValues(const Image<uint16_t>& raw_dn, const PixelPlane& plane);

}  // namespace sightline
