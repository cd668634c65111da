// SPDX-License-Identifier: Apache-2.0
// Map of standardised residuals over the image as a drawing.
#pragma once

#include <string>
#include <vector>

namespace sightline {

struct RegionMapGrid {
  int rows = 0, columns = 0;
  // One more than rows and columns, increasing [px]; empty: all of one size.
  std::vector<double> row_edges_px, column_edges_px;
  std::vector<float> z;  // rows x columns, row by row; not finite: no data
};

// An <svg> element; orange where more is observed than expected, blue where less, pale where |z|
// < 1.
std::string RegionMapSvg(const RegionMapGrid& grid, const std::string& title);

// Key to its colours.
std::string RegionMapKeySvg();

}  // namespace sightline
