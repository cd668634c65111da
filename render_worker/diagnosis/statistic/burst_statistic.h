// SPDX-License-Identifier: Apache-2.0
// What a frame leaves in the next one of the same burst.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// Each value is a contrast between rows: row means of a frame (or of its difference from an earlier
// recording of the same scene and settings) times weights that follow the preceding frame's line,
// scaled so that the value is the part of the preceding signal that is seen again.
//   - dark frame right after one with light: 0 expected;
//   - repeats in a burst that follow frames of different brightness: 0 expected, speckle cancels.
// Entry per value.
class BurstStatistic : public SetStatistic {
 public:
  explicit BurstStatistic(const RecordedSet& set);

  std::string_view name() const override { return "burst"; }
  int entries() const override { return static_cast<int>(entries_.size()); }
  const std::vector<int>& Frames(int entry) const override { return entries_[entry].frames; }
  int FrameOfRow(int entry, int /*row*/) const override { return entries_[entry].seen; }
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

 private:
  struct Entry {
    std::vector<int> frames;
    int seen = 0;
    int compared = -1;            // earlier recording of the same; -1: a dark frame
    int preceding = 0;            // of `seen`
    int preceding_compared = -1;  // of `compared`; -1: none
    double columns_px = 0;
    std::vector<double> weights;  // of the rows, from the recordings; empty: not recorded yet
  };
  std::vector<double> Weights(const ExpectedSet& expected, const Entry& entry) const;

  std::vector<Entry> entries_;
};

}  // namespace sightline
