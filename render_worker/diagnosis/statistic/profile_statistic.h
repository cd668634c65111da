// SPDX-License-Identifier: Apache-2.0
// Mean profile across the line, in blocks along it: the observable most effects show in. Recordings
// of one plate position share their speckle, so they are compared together, with the covariance
// that speckle and noise give their means.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline {

struct ProfileGroup {
  std::vector<int> frames;                    // of the set
  std::vector<std::vector<ProfileBin>> bins;  // of every frame
  int size = 0;                               // entries of a block's vector
  std::vector<bool> in_focus;                 // every frame
  int columns_px = 0;                         // of the frames
  int preceding = -1;                         // of a dark frame that follows light; -1: none
  int sharing = 1;                            // groups that see the same pixels of the sensor
};

class ProfileStatistic : public SetStatistic {
 public:
  // Bins follow the nominal line: narrow on it, growing outwards.
  ProfileStatistic(const RecordedSet& set, int blocks_along_line);

  // Entry group * blocks + block: means of the bins of a group's frames, one after the other [DN].
  std::string_view name() const override { return "profile"; }
  int entries() const override { return static_cast<int>(groups_.size()) * blocks_; }
  const std::vector<int>& Frames(int entry) const override {
    return groups_[entry / blocks_].frames;
  }
  int FrameOfRow(int entry, int row) const override;
  // Distance of a bin from the nominal line [px].
  double OffsetOfRow(int entry, int row) const;
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

  const std::vector<ProfileGroup>& groups() const { return groups_; }
  const std::vector<PixelPlane>& planes() const { return planes_; }

 private:
  Eigen::VectorXd ErrorOfWhatIsLeft(const ProfileGroup& members,
                                    const std::vector<ExpectedFrame>& strips, int columns,
                                    int step) const;

  int blocks_;
  std::vector<PixelPlane> planes_;
  std::vector<ProfileGroup> groups_;
};

}  // namespace sightline
