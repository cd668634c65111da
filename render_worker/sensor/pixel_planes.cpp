// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/pixel_planes.h"

namespace sightline {

std::vector<PixelPlane> PixelPlanes(const Sensor& sensor) {
  if (sensor.colour_filter == ColourFilter::kMono) return {{0, 0, 1}};
  return {{0, 0, 2}, {0, 1, 2}, {1, 0, 2}, {1, 1, 2}};
}

Image<float> PlaneValues(const Image<uint16_t>& raw_dn, const PixelPlane& plane) {
  const auto count = [&](int size, int first) {
    return (size - first + plane.step - 1) / plane.step;
  };
  Image<float> values(count(raw_dn.columns_px, plane.first_column),
                      count(raw_dn.rows_px, plane.first_row));
  for (int row = 0; row < values.rows_px; ++row) {
    const uint16_t* from = raw_dn.Row(plane.first_row + row * plane.step) + plane.first_column;
    for (int column = 0; column < values.columns_px; ++column) {
      values.At(row, column) = from[ptrdiff_t{column} * plane.step];
    }
  }
  return values;
}

}  // namespace sightline
