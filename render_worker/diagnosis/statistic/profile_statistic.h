// SPDX-License-Identifier: Apache-2.0
// Mean profile across the line, in segments along it: the observable in which most effects show.
// Recordings of one plate position share their speckle, so they form one observation block with the
// covariance that speckle and noise give their means.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

// Recordings of a plate position, or one dark frame.
struct ProfileGroup {
  std::vector<int> frames;                    // in order of time
  std::vector<std::vector<ProfileBin>> bins;  // of every frame
  int size = 0;                               // components of a block: bins of all frames
  std::vector<bool> in_focus;                 // every frame
  int columns_px = 0;                         // of the frames
  int preceding = -1;                         // lit frame just before a dark one; -1: none
  int sharing = 1;                            // groups of the same region of the sensor
};

// Observation block group * segments + segment: means of the bins of a group's frames in a segment,
// frame by frame [DN]. Bins are narrow on the nominal line and grow outwards.
class ProfileStatistic : public SetStatistic {
 public:
  ProfileStatistic(const RecordedSet& set, int segments_along_line);

  StatisticKind kind() const override { return StatisticKind::kProfile; }
  std::string_view name() const override { return "profile"; }
  int blocks() const override { return static_cast<int>(groups_.size()) * segments_; }
  const std::vector<int>& Frames(int block) const override {
    return groups_[block / segments_].frames;
  }
  int FrameOfComponent(int block, int component) const override;
  // Distance of a component's bin from the nominal line [px].
  double OffsetOfComponent(int block, int component) const;
  Eigen::VectorXd Observed(const RecordedSet& set, int block) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int block) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int block) const override;

  const std::vector<ProfileGroup>& groups() const { return groups_; }
  const std::vector<PixelPlane>& planes() const { return planes_; }

 private:
  int segments_;
  std::vector<PixelPlane> planes_;
  std::vector<ProfileGroup> groups_;
};

}  // namespace sightline
