// SPDX-License-Identifier: Apache-2.0
// Frequencies of raw values: they show converters with stuck bits, pixels that saturate before the
// converter does, and black levels that are cut off.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// One observation block per recording. Components with laser:
//   - for each of the lowest bits, the mean of +1 where it is set and -1 where it is not. Pixels
//   are
//     weighted by a smooth window over the raw values. Every smooth histogram much wider than the
//     bit then has an expectation of 0, because the window's Fourier transform vanishes at the
//     bit's frequency;
//   - the raw value that only a few pixels exceed [DN]: the plateau if pixels saturate.
// In the dark: 2 sqrt(n + 3/8) for n pixels that read 0, a transform of variance 1 (Anscombe,
// Biometrika 35 (1948) 246).
class HistogramStatistic : public SetStatistic {
 public:
  explicit HistogramStatistic(const RecordedSet& set);

  StatisticKind kind() const override { return StatisticKind::kHistogram; }
  std::string_view name() const override { return "histogram"; }
  int blocks() const override { return static_cast<int>(blocks_.size()); }
  const std::vector<int>& Frames(int block) const override { return blocks_[block].frames; }
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  struct Block {
    std::vector<int> frames;  // one
    bool laser = false;
    double columns_px = 0, rows_px = 0;
    std::vector<double> window;  // weight of every raw value
    // Effective number of pixels in the window; -1: the set is only planned.
    double counted = -1;
  };

  std::vector<Block> blocks_;
};

}  // namespace sightline
