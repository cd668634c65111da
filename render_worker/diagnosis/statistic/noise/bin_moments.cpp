// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/noise/bin_moments.h"

namespace sightline {

double MeanOfBin(const Image<uint16_t>& raw, const PixelPlane& plane, const ProfileBin& bin) {
  double sum = 0, count = 0;
  for (int row : bin.rows) {
    for (int c = plane.first_column; c < raw.columns_px; c += plane.step) {
      sum += raw.At(row, c);
      ++count;
    }
  }
  return sum / count;
}

double PixelVariance(const ExpectedFrame& sample, int row, const PixelPlane& plane) {
  return MeanOfColumns(sample.noise_variance_dn2, row, plane) +
         MeanOfColumns(sample.pattern_variance_dn2, row, plane);
}

double MeanExcessKurtosis(const ExpectedSet& expected, int frame, const PixelPlane& plane,
                          const ProfileBin& bin) {
  double sum = 0;
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    for (int row : bin.rows) sum += samples[frame].NoiseExcessKurtosis(row, plane.first_column);
  }
  return sum / static_cast<double>(bin.rows.size() * expected.strips.size());
}

}  // namespace sightline
