// SPDX-License-Identifier: Apache-2.0
// Compares odd with even columns of the sensor. They differ if neighbouring columns are read by
// different amplifiers.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// The pixels of one recording that are compared.
struct ParityBlock {
  std::vector<int> frames;  // one
  RegionOfInterest roi;
  int first_row = 0, rows = 0;  // that hold the line and its flanks
  double dark_dn = 0;           // nominal mean in the dark
  // Blocks of the same speckle share its deviation, and blocks of the same region that of the
  // sensor's fixed pattern: these variances are multiplied by the numbers of blocks.
  int sharing_speckle = 1, sharing_pattern = 1;
};

// One observation block of one component per laser recording with light and hardly any saturation:
//   D = 2 sum_rc w_c s_c (x_rc - dark) / sum_rc w_c (x_rc - dark),
// s_c = 1 in odd and -1 in even columns of the sensor, counted from the principal point; w_c a Hann
// window over the region. The window's transform vanishes near the highest frequency, so light that
// changes slowly along the line cancels. D is the difference of the two gains over their mean.
// Only pixels of one colour count: all of a mono sensor, the green ones of a Bayer sensor.
// Their columns alternate with the rows, so a line as narrow as a pixel contributes to D,
// equally in recordings and expectation. DarkStatistic and FixedPatternStatistic cover dark
// differences.
class ColumnParityStatistic : public SetStatistic {
 public:
  explicit ColumnParityStatistic(const RecordedSet& set);

  StatisticKind kind() const override { return StatisticKind::kColumnParity; }
  std::string_view name() const override { return "column parity"; }
  int blocks() const override { return static_cast<int>(blocks_.size()); }
  const std::vector<int>& Frames(int block) const override { return blocks_[block].frames; }
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  std::vector<ParityBlock> blocks_;
};

}  // namespace sightline
