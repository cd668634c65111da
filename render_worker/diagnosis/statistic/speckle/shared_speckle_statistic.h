// SPDX-License-Identifier: Apache-2.0
// Recordings of one plate position share their speckle: one exposure predicts the other pixel by
// pixel, and the rest is temporal noise. Speckle and the line's profile and width cancel. What
// remains shows the sensor's response and the exposure times, as a photon transfer measurement
// does.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/diagnosis/statistic/speckle/exposure_pair.h"

namespace sightline {

// One observation block per plate position with several recordings through the same optics. For
// every pair of these that is adjacent in exposure time (ExposurePair) its components are
//   - mean of y_b - r y_a [DN] over the pixels of each bin of y_a + y_b;
//   - mean of y_b [DN] over the pixels that y_a shows to be saturated in y_b;
//   - variance of y_b - r y_a within the bins over its nominal value by shot noise and dark noise:
//     1, and more if the speckle has moved between the recordings.
class SharedSpeckleStatistic : public SetStatistic {
 public:
  explicit SharedSpeckleStatistic(const RecordedSet& set) : blocks_(MakeSharedSpeckleBlocks(set)) {}

  StatisticKind kind() const override { return StatisticKind::kSharedSpeckle; }
  std::string_view name() const override { return "shared speckle"; }
  bool compares_speckle() const override { return true; }
  int blocks() const override { return static_cast<int>(blocks_.size()); }
  const std::vector<int>& Frames(int block) const override { return blocks_[block].frames; }
  int FrameOfComponent(int block, int component) const override;
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  std::vector<SharedSpeckleBlock> blocks_;
};

}  // namespace sightline
