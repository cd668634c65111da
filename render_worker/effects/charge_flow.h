// SPDX-License-Identifier: Apache-2.0
// Charge that moves between neighbouring pixels.
#pragma once

#include <vector>

#include "core/image/image.h"

namespace sightline {

// Adds to every pixel the charge from its four neighbours within the image: flow(from, to) is
// gained by `to` and lost by `from`, given both charges before any flow. Nothing crosses the
// image's edge (the light continues there, so in- and outflow are equal), and the sum is conserved.
template <typename Flow>
void MoveCharge(Image<double>& electrons, const Flow& flow) {
  std::vector<double> before_row(electrons.values.begin(),
                                 electrons.values.begin() + electrons.columns_px);
  std::vector<double> row = before_row;
  for (int i = 0; i < electrons.rows_px; ++i) {
    const double* next = i + 1 < electrons.rows_px ? electrons.Row(i + 1) : nullptr;
    double* out = electrons.Row(i);
    row.assign(out, out + electrons.columns_px);
    for (int j = 0; j < electrons.columns_px; ++j) {
      double gain = 0;
      if (i > 0) gain += flow(before_row[j], row[j]);
      if (next != nullptr) gain += flow(next[j], row[j]);
      if (j > 0) gain += flow(row[j - 1], row[j]);
      if (j + 1 < electrons.columns_px) gain += flow(row[j + 1], row[j]);
      out[j] += gain;
    }
    before_row.swap(row);
  }
}

}  // namespace sightline
