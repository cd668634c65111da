// SPDX-License-Identifier: Apache-2.0
// Patterns that stay on the sensor while speckle and noise change: mean products of the residuals
// of different recordings at the same or neighbouring pixels.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/pattern/pattern_group.h"
#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// One observation block per group of recordings of the same region: with laser, one recording of
// each plate position, so that their speckle is independent (sensitivity_pattern.h); and dark
// frames (dark_pattern.h).
class FixedPatternStatistic : public SetStatistic {
 public:
  explicit FixedPatternStatistic(const RecordedSet& set);

  StatisticKind kind() const override { return StatisticKind::kFixedPattern; }
  std::string_view name() const override { return "fixed pattern"; }
  int blocks() const override { return static_cast<int>(groups_.size()); }
  const std::vector<int>& Frames(int block) const override { return groups_[block].frames; }
  int FrameOfComponent(int block, int component) const override;
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  // With laser all components, of dark frames the two products. Empty for narrow regions.
  std::vector<Eigen::VectorXd> ObservedOfParts(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  std::vector<PatternGroup> groups_;
};

}  // namespace sightline
