// SPDX-License-Identifier: Apache-2.0
// Temporal noise from pairs of repeated recordings.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"

namespace sightline {

// One observation block per pair of successive recordings of the same scene with the same settings.
// Its components are half the mean squared difference of every bin, which is the temporal variance
// [DN^2] (photon transfer, EMVA 1288 release 4.0, section 2.4). A factor that the two recordings
// differ by (laser power) is removed first. The expectation is evaluated at the recorded mean,
// because the speckle of a plate position makes all of its recordings brighter or darker than
// expected.
class RepeatStatistic : public SetStatistic {
 public:
  explicit RepeatStatistic(const RecordedSet& set);

  StatisticKind kind() const override { return StatisticKind::kTemporalNoise; }
  std::string_view name() const override { return "temporal noise"; }
  bool compares_speckle() const override { return true; }
  int blocks() const override { return static_cast<int>(blocks_.size()); }
  const std::vector<int>& Frames(int block) const override { return blocks_[block].frames; }
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  struct Block {
    std::vector<int> frames;  // two
    std::vector<ProfileBin> bins;
    std::vector<double> recorded_mean_dn;  // of the bins; empty: the set is only planned
    int columns_px = 0;
  };
  std::vector<PixelPlane> planes_;
  std::vector<Block> blocks_;
};

}  // namespace sightline
