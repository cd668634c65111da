// SPDX-License-Identifier: Apache-2.0
// Spatial statistics of speckle: its contrast and the correlation of neighbouring pixels.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"

namespace sightline {

// One observation block per laser recording. Its components are
//   - for every plane of the colour filter: variance of the unlit background [DN^2];
//   - for every plane that is bright enough and does not saturate: squared contrast of the line's
//     core (variance of the pixels about the mean of their segment and row, over the squared mean
//     signal), and the correlation of neighbours at lags 1 and 2 of the plane, along and across the
//     line.
// The line's flanks are left out: the rim of the pupil alone makes their speckle, which the model
// does not describe.
class TextureStatistic : public SetStatistic {
 public:
  TextureStatistic(const RecordedSet& set, int segments_along_line);

  StatisticKind kind() const override { return StatisticKind::kTexture; }
  std::string_view name() const override { return "texture"; }
  int blocks() const override { return static_cast<int>(blocks_.size()); }
  const std::vector<int>& Frames(int block) const override { return blocks_[block].frames; }
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

 private:
  using Bins = std::vector<ProfileBin>;
  struct Block {
    std::vector<int> frames;  // one
    std::vector<Bins> cores;  // bins of the line's core, per plane that is used
    Bins backgrounds;         // one per plane
    int columns_px = 0;
    // Blocks of recordings of the same speckle. They repeat the same information, so each has its
    // sampling variance multiplied by their number.
    int sharing = 1;
  };

  Bins CoreOf(const RecordedFrame& recorded, const ExpectedFrame* nominal, Bins bins) const;
  Block MakeBlock(const RecordedFrame& recorded, int frame) const;

  int segments_;
  std::vector<PixelPlane> planes_;
  Sensor nominal_sensor_;
  std::vector<Block> blocks_;
};

}  // namespace sightline
