// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/pattern/relative_residuals.h"

#include <cmath>
#include <cstddef>

#include "render_worker/recordings/strips.h"

namespace sightline {

RelativeResiduals MakeRelativeResiduals(const Image<uint16_t>& raw, double offset_dn, double top_dn,
                                        int segments) {
  RelativeResiduals residuals{Image<double>(raw.columns_px, raw.rows_px, 0.0),
                              std::vector<double>(2 * static_cast<size_t>(raw.rows_px), 0)};
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int parity = 0; parity < 2; ++parity) {
      double total = 0, square = 0;
      int pixels = 0;
      for (int segment = 0; segment < segments; ++segment) {
        const auto [first, last] = BlockColumns(raw.columns_px, segments, segment);
        double sum = 0;
        int count = 0;
        for (int c = first + parity; c < last; c += 2, ++count) sum += raw.At(row, c);
        for (int c = first + parity; c < last; c += 2) {
          residuals.value.At(row, c) = raw.At(row, c) - sum / count;
          square += std::pow(residuals.value.At(row, c), 2);
        }
        total += sum;
        pixels += count;
      }
      const double signal = total / pixels - offset_dn, variance = square / pixels;
      const bool used = signal > kLeastSignal_relative * top_dn && variance > 0;
      const double scale = used ? signal / variance : 0;
      for (int c = parity; c < raw.columns_px; c += 2) residuals.value.At(row, c) *= scale;
      residuals.weights[2 * row + parity] = scale * signal;
    }
  }
  return residuals;
}

}  // namespace sightline
