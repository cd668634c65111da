// SPDX-License-Identifier: Apache-2.0
// Segments along the line, and the narrow column samples on which the model is evaluated.
#pragma once

#include <utility>

#include "render_worker/frame/frame_setup.h"

namespace sightline {

// First column of block `block` of `blocks`, and one past its last; even, so that it starts with a
// Bayer cell.
inline std::pair<int, int> BlockColumns(int columns_px, int blocks, int block) {
  const auto edge = [&](int i) { return i * columns_px / blocks / 2 * 2; };
  return {edge(block), block + 1 == blocks ? columns_px : edge(block + 1)};
}

// The region, cut to at most `width_px` (even) columns in the middle of a block.
inline RegionOfInterest StripRegion(const RegionOfInterest& roi, int blocks, int block,
                                    int width_px) {
  const auto [first, last] = BlockColumns(roi.columns_px, blocks, block);
  const int width = width_px < last - first ? width_px : last - first;
  const int offset = first + (last - first - width) / 4 * 2;
  return {roi.column_px + offset, roi.row_px, width, roi.rows_px};
}

}  // namespace sightline
