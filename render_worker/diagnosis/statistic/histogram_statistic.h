// SPDX-License-Identifier: Apache-2.0
// Which raw numbers occur: converters with stuck bits, pixels that are full before the converter
// is, black that is cut off.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// Entry per recording. With laser:
//   - for each of the lowest bits, mean of +1 where it is set and -1 where not. Pixels count by a
//     smooth window over the numbers, so that 0 is expected of any smooth histogram much wider than
//     the bit (the window's Fourier transform vanishes at the bit's frequency);
//   - the number that only a few pixels exceed [DN]: the plateau if pixels are full.
// In the dark: 2 sqrt(n + 3/8), n the pixels that read 0 (Anscombe 1948: variance 1).
class HistogramStatistic : public SetStatistic {
 public:
  explicit HistogramStatistic(const RecordedSet& set);

  std::string_view name() const override { return "histogram"; }
  int entries() const override { return static_cast<int>(entries_.size()); }
  const std::vector<int>& Frames(int entry) const override { return entries_[entry].frames; }
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

 private:
  struct Entry {
    std::vector<int> frames;  // one
    bool laser = false;
    double columns_px = 0, rows_px = 0;
    std::vector<double> window;  // of every number
    double counted = -1;         // pixels the window counts, of the recording; -1: not recorded yet
  };
  std::vector<Entry> entries_;
};

}  // namespace sightline
