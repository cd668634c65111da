// SPDX-License-Identifier: Apache-2.0
// Square blocks of pixels over the images of a set, numbered by recording, row and column.
#pragma once

namespace sightline {

struct BlockGrid {
  int recordings = 0;
  int rows = 0, columns = 0;  // blocks of one image
  int block_px = 1;           // pixels on a side of a block
  int tile_blocks = 1;        // blocks on a side of a tile

  int count() const { return recordings * rows * columns; }
  int Index(int recording, int row, int column) const {
    return (recording * rows + row) * columns + column;
  }
  int RecordingOf(int index) const { return index / (columns * rows); }
  int RowOf(int index) const { return index / columns % rows; }
  int ColumnOf(int index) const { return index % columns; }
  // Tiles are held out in turn, like the black fields of a chessboard.
  bool HeldOut(int index) const {
    return (RowOf(index) / tile_blocks + ColumnOf(index) / tile_blocks) % 2 == 1;
  }
  // Pixels covered by blocks; those beyond the last whole block are left out.
  int rows_px() const { return rows * block_px; }
  int columns_px() const { return columns * block_px; }
};

}  // namespace sightline
