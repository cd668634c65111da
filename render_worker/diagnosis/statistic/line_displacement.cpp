// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/line_displacement.h"

#include <algorithm>
#include <vector>

namespace sightline {

namespace {

struct Moments {
  double centroid = 0, variance = 0;  // [rows]; 0 where nothing is lit
};

Moments MomentsOf(const std::vector<double>& rows) {
  std::vector<double> sorted = rows;
  std::sort(sorted.begin(), sorted.end());
  const double background = sorted[sorted.size() / 4];
  const double threshold = background + 0.1 * (sorted.back() - background);
  double sum = 0, moment = 0, square = 0;
  for (size_t row = 0; row < rows.size(); ++row) {
    if (rows[row] <= threshold) continue;
    const auto place = static_cast<double>(row);
    sum += rows[row] - background;
    moment += (rows[row] - background) * place;
    square += (rows[row] - background) * place * place;
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
  // Both rows of a Bayer cell together.
  for (int row = 0; row + 1 < raw.rows_px; ++row) {
    seen[row] += seen[row + 1];
    modelled[row] += modelled[row + 1];
  }
  const Moments of_seen = MomentsOf(seen), of_modelled = MomentsOf(modelled);
  return {of_seen.centroid - of_modelled.centroid, of_seen.variance - of_modelled.variance};
}

}  // namespace sightline
