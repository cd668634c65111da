// SPDX-License-Identifier: Apache-2.0
// Noise of dark frames.
#pragma once

#include <utility>
#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// One observation block per dark frame that does not follow a lit one. Its components are the
// variance of the pixels, of the means of rows and of the means of columns [DN^2], and the fraction
// of pixels that are outliers. The mean of a dark frame belongs to ProfileStatistic.
class DarkStatistic : public SetStatistic {
 public:
  explicit DarkStatistic(const RecordedSet& set);

  StatisticKind kind() const override { return StatisticKind::kDarkFrames; }
  std::string_view name() const override { return "dark frames"; }
  int blocks() const override { return static_cast<int>(frames_.size()); }
  const std::vector<int>& Frames(int block) const override { return frames_[block]; }
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  std::vector<std::vector<int>> frames_;
  std::vector<std::pair<int, int>> sizes_px_;  // columns, rows
};

}  // namespace sightline
