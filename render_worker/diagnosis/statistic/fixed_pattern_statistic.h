// SPDX-License-Identifier: Apache-2.0
// Patterns that stay on the sensor while speckle and noise change: mean products of the residuals
// of different recordings at the same or neighbouring pixels.
#pragma once

#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"

namespace sightline {

// Entry per group of recordings of the same region.
//
// With laser, one recording of each plate position, so that their speckle is independent: mean
// product of relative residuals of the pixels of two recordings, over all pairs, at several
// distances on the sensor: autocovariance of a pattern of sensitivity. Residuals are about the mean
// of a row's block and weigh by the inverse of their variance. Null: 0.
//
// In the dark, in units of the nominal dark noise: mean product of the pixels' residuals of
// different recordings (limited to 4 standard deviations, so that few hot pixels do not stand for
// all); of columns' means, without the part the pixels explain; and for each recording 2 sqrt(n +
// 3/8), n the pixels above 5 standard deviations both there and in the longest exposure.
class FixedPatternStatistic : public SetStatistic {
 public:
  explicit FixedPatternStatistic(const RecordedSet& set);

  std::string_view name() const override { return "fixed pattern"; }
  int entries() const override { return static_cast<int>(entries_.size()); }
  const std::vector<int>& Frames(int entry) const override { return entries_[entry].frames; }
  int FrameOfRow(int entry, int row) const override;
  Eigen::VectorXd Observed(const RecordedSet& set, int entry) const override;
  Eigen::VectorXd Expected(const ExpectedSet& expected, int entry) const override;
  Eigen::MatrixXd Covariance(const ExpectedSet& expected, int entry) const override;

 private:
  // Information on relative sensitivity of a pixel: squared signal over variance, of every row, of
  // its even and odd columns; 0 where there is hardly light.
  using RowWeights = std::vector<double>;
  struct Entry {
    std::vector<int> frames;
    bool laser = false;
    RegionOfInterest roi;
    double offset_dn = 0;             // nominal mean in the dark
    double noise_dn = 0;              // nominal deviation in the dark
    size_t longest = 0;               // of dark frames: index into `frames`
    std::vector<RowWeights> weights;  // of every frame, from the recordings; empty: none yet
  };

  // A draw of what effects add to frames in the dark, in units of the nominal dark noise.
  struct DarkPattern {
    std::vector<Image<double>> frames;
    bool even = true;  // in every frame
  };

  DarkPattern DarkPatternOf(const ExpectedSet& expected, const Entry& entry) const;
  Eigen::VectorXd ObservedPattern(const RecordedSet& set, const Entry& entry) const;
  Eigen::VectorXd ObservedDark(const RecordedSet& set, const Entry& entry) const;
  Eigen::VectorXd ExpectedPattern(const ExpectedSet& expected, const Entry& entry) const;
  Eigen::VectorXd ExpectedDark(const ExpectedSet& expected, const Entry& entry) const;
  Eigen::MatrixXd CovarianceOfPattern(const ExpectedSet& expected, const Entry& entry) const;
  Eigen::MatrixXd CovarianceInDark(const ExpectedSet& expected, const Entry& entry) const;
  // Autocovariances of the pattern that effects make of even light, one a draw; empty: none.
  std::vector<Eigen::VectorXd> DrawnPatterns(const ExpectedSet& expected, const Entry& entry) const;
  std::vector<RowWeights> Weights(const ExpectedSet& expected, const Entry& entry) const;

  int blocks_ = 4;
  std::vector<Entry> entries_;
};

}  // namespace sightline
