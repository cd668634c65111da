// SPDX-License-Identifier: Apache-2.0
// What profiles do not show: scatter. Spatial variance and correlation of speckle, temporal noise
// between repeats, dark frames.
#pragma once

#include <utility>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"

namespace sightline {

// Entry per laser recording. Of every plane that is bright enough and not cut off: squared contrast
// of the line's middle (variance of the pixels about the mean of their block and row, over the
// squared mean signal), and the correlation of neighbours along and across it (lags 1 and 2 of the
// plane). Of every plane: variance of the background [DN^2]. The line's flanks are left out:
// speckle there is made by the rim of the pupil alone, which its statistics here do not describe.
class TextureStatistic : public SetStatistic {
 public:
  TextureStatistic(const RecordedSet& set, int blocks_along_line);

  std::string_view name() const override { return "texture"; }
  int entries() const override { return static_cast<int>(entries_.size()); }
  const std::vector<int>& Frames(int entry) const override { return entries_[entry].frames; }
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

 private:
  struct Entry {
    std::vector<int> frames;                     // one
    std::vector<std::vector<ProfileBin>> cores;  // bins of the line's middle, of every plane used
    std::vector<ProfileBin> backgrounds;         // one of every plane
    int columns_px = 0;
    int sharing = 1;  // entries about the same speckle: together they say what one does
  };
  int blocks_;
  std::vector<PixelPlane> planes_;
  Sensor nominal_sensor_;
  std::vector<Entry> entries_;
};

// Entry per pair of recordings of the same scene with the same settings, one after the other: half
// the mean squared difference of every bin, the temporal variance [DN^2]. It is expected at the
// mean that has been recorded (photon transfer, EMVA 1288 release 4.0, section 2.4): the speckle of
// a place makes all of its recordings brighter or darker than is expected of any.
class RepeatStatistic : public SetStatistic {
 public:
  explicit RepeatStatistic(const RecordedSet& set);

  std::string_view name() const override { return "temporal noise"; }
  bool compares_speckle() const override { return true; }
  int entries() const override { return static_cast<int>(entries_.size()); }
  const std::vector<int>& Frames(int entry) const override { return entries_[entry].frames; }
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

 private:
  struct Entry {
    std::vector<int> frames;  // two
    std::vector<ProfileBin> bins;
    std::vector<double> recorded_mean_dn;  // of the bins; empty: nothing is recorded yet
    int columns_px = 0;
  };
  std::vector<PixelPlane> planes_;
  std::vector<Entry> entries_;
};

// Entry per dark frame: variance of the pixels, of the means of rows and of the means of columns
// [DN^2], and the share of pixels beyond six deviations. (Their mean is a profile.)
class DarkStatistic : public SetStatistic {
 public:
  explicit DarkStatistic(const RecordedSet& set);

  std::string_view name() const override { return "dark frames"; }
  int entries() const override { return static_cast<int>(frames_.size()); }
  const std::vector<int>& Frames(int entry) const override { return frames_[entry]; }
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

 private:
  std::vector<std::vector<int>> frames_;
  std::vector<std::pair<int, int>> sizes_px_;  // columns, rows
};

}  // namespace sightline
