// SPDX-License-Identifier: Apache-2.0
// A raster of values: images, irradiance maps, layers.
#pragma once

#include <cstddef>
#include <vector>

namespace sightline {

// Row-major; row 0 is the top row of the image, column 0 its left column.
template <typename T>
struct Image {
  int columns_px = 0;
  int rows_px = 0;
  std::vector<T> values;

  Image() = default;
  Image(int columns, int rows, T value = T())
      : columns_px(columns), rows_px(rows), values(static_cast<size_t>(columns) * rows, value) {}

  bool empty() const { return values.empty(); }
  T& At(int row, int column) { return values[static_cast<size_t>(row) * columns_px + column]; }
  const T& At(int row, int column) const {
    return values[static_cast<size_t>(row) * columns_px + column];
  }
  T* Row(int row) { return values.data() + static_cast<size_t>(row) * columns_px; }
  const T* Row(int row) const { return values.data() + static_cast<size_t>(row) * columns_px; }

  friend bool operator==(const Image&, const Image&) = default;
};

}  // namespace sightline
