// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/line_displacement.h"

#include <algorithm>
#include <vector>

namespace sightline {

namespace {

// Background: this quantile of the rows. Chosen: fewer than three quarters of the rows are lit.
constexpr size_t kBackgroundQuarters = 4;
// Rows below this fraction of the range above the background are left out. Chosen: noise is lower.
constexpr double kThreshold = 0.1;

struct LineMoments {
  double centroid = 0, variance = 0;  // [rows, squared rows]; 0 where nothing is lit
};

LineMoments MomentsOf(const std::vector<double>& rows) {
  std::vector<double> sorted = rows;
  std::sort(sorted.begin(), sorted.end());
  const double background = sorted[sorted.size() / kBackgroundQuarters];
  const double threshold = background + kThreshold * (sorted.back() - background);
  double sum = 0, moment = 0, square = 0;
  for (size_t row = 0; row < rows.size(); ++row) {
    if (rows[row] <= threshold) continue;
    const auto position = static_cast<double>(row);
    sum += rows[row] - background;
    moment += (rows[row] - background) * position;
    square += (rows[row] - background) * position * position;
  }
  if (!(sum > 0)) return {};
  const double centroid = moment / sum;
  return {centroid, square / sum - centroid * centroid};
}

}  // namespace

LineDisplacement DisplacementOfLine(const RecordedSet& set, const ExpectedSet& expected,
                                    int frame) {
  const Image<uint16_t>& raw = set.frames[frame].raw_dn;
  std::vector<double> seen(raw.rows_px, 0), modelled(raw.rows_px, 0);
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int c = 0; c < raw.columns_px; ++c) seen[row] += raw.At(row, c);
    for (const std::vector<ExpectedFrame>& strips : expected.strips) {
      for (int c = 0; c < 2; ++c) modelled[row] += strips[frame].MeanDn(row, c);
    }
  }
  // Sums of adjacent rows contain all colours of a Bayer cell.
  for (int row = 0; row + 1 < raw.rows_px; ++row) {
    seen[row] += seen[row + 1];
    modelled[row] += modelled[row + 1];
  }
  const LineMoments of_seen = MomentsOf(seen), of_modelled = MomentsOf(modelled);
  return {of_seen.centroid - of_modelled.centroid, of_seen.variance - of_modelled.variance};
}

}  // namespace sightline
