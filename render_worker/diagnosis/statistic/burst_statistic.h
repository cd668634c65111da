// SPDX-License-Identifier: Apache-2.0
// Image lag: how much of a frame's signal is seen again in the next frame of the same burst.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// One observation block of one component per suitable frame. The component is a contrast between
// rows: the row means of the frame (or of its difference from an earlier recording of the same
// scene and settings), regressed on those of the preceding frame. It is the fraction of the
// preceding signal that is seen again. Suitable frames are
//   - dark frames just after a lit one;
//   - repeats that follow frames of different brightness; their speckle cancels in the difference.
// Without image lag the expectation is 0.
class BurstStatistic : public SetStatistic {
 public:
  explicit BurstStatistic(const RecordedSet& set);

  StatisticKind kind() const override { return StatisticKind::kBurst; }
  std::string_view name() const override { return "burst"; }
  int blocks() const override { return static_cast<int>(blocks_.size()); }
  const std::vector<int>& Frames(int block) const override { return blocks_[block].frames; }
  int FrameOfComponent(int block, int /*component*/) const override { return blocks_[block].seen; }
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  struct Block {
    std::vector<int> frames;
    int seen = 0;                 // the frame that may show the lag
    int compared = -1;            // earlier recording of the same scene; -1: `seen` is dark
    int preceding = 0;            // frame just before `seen`
    int preceding_compared = -1;  // frame just before `compared`; -1: none
    double columns_px = 0;
    std::vector<double>
        weights;  // of the rows, from the recordings; empty: the set is only planned
  };
  static bool FindComparison(const RecordedSet& set, Block& block);
  static std::vector<double> Weights(const ExpectedSet& expected, const Block& block);

  std::vector<Block> blocks_;
};

}  // namespace sightline
