// SPDX-License-Identifier: Apache-2.0
// Statistics of the frames of one step of a sensor set (uniform light or dark): means, temporal
// noise with its correlations, and the averaged frame. Frames are added one by one, so memory is
// independent of their number.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "core/image/image.h"
#include "render_worker/sensor/emva1288_measurement.h"

namespace sightline {

// Temporal noise between frames of the same conditions. It is computed from differences of frames
// minus their mean, so that it contains neither the fixed pattern nor changes of the overall light.
// Standard errors come from the differences between parts of the image.
struct TemporalNoise {
  // Half the variance of the difference of frames one, two and three apart [DN^2]. It is the
  // temporal variance if frames are independent (EMVA 1288 R4.0, clause 6.6). Unset: there are no
  // frames that far apart.
  std::optional<Estimate> variance_1_apart_dn2, variance_2_apart_dn2, variance_3_apart_dn2;
  // Covariance of a pixel's noise with that of its neighbour in the same row, and in the same
  // column [DN^2].
  Estimate covariance_in_row_dn2, covariance_in_column_dn2;
  // Variance of the noise common to all pixels of a row, or of a column, in one frame [DN^2]; may
  // be negative by chance.
  Estimate row_variance_dn2, column_variance_dn2;
};

struct FlatFieldStatistics {
  bool dark = false;
  double exposure_time_s = 0;
  std::optional<double> photons;
  PairStatistics pair;                // the first two frames
  std::vector<double> frame_mean_dn;  // in the order of the files
  TemporalNoise noise;
  double share_at_zero = 0, share_at_largest = 0;  // of all pixels of all frames
  int largest_seen_dn = 0;                         // largest number of all pixels of all frames
  double share_at_largest_seen = 0;                // of all pixels of all frames
  Image<double> mean_dn;                           // averaged frame; only with `keep_mean`
  int frames() const { return static_cast<int>(frame_mean_dn.size()); }
  double MeanDn() const;
};

class FlatFieldAccumulator {
 public:
  // `largest_dn`: the largest raw value, 2^bits - 1. `keep_mean`: compute the averaged frame.
  FlatFieldAccumulator(double largest_dn, bool keep_mean);

  // Frames have one size, at least 8 x 8.
  void Add(const Image<uint16_t>& frame_dn);
  // At least two frames must have been added. The caller sets the conditions of the step.
  FlatFieldStatistics Finish() const;

 private:
  // Sums over one part of the image and over all differences of frames.
  struct PartSums {
    double pixels = 0, pairs_in_row = 0, pairs_in_column = 0;
    double squares[3] = {0, 0, 0}, count[3] = {0, 0, 0};
    double in_row = 0, in_column = 0;
  };
  void AddDifference(const Image<uint16_t>& a, const Image<uint16_t>& b, int apart);

  const double largest_dn_;
  const bool keep_mean_;
  std::deque<Image<uint16_t>> last_;  // at most three, the latest first
  std::vector<PartSums> parts_;
  std::vector<double> row_mean_squares_, column_mean_squares_;  // one per difference
  std::vector<double> frame_mean_dn_;
  std::optional<PairStatistics> pair_;
  double at_zero_ = 0, at_largest_ = 0, at_largest_seen_ = 0;
  int largest_seen_dn_ = 0;
  Image<double> sum_;
  int rows_ = 0, columns_ = 0;
};

}  // namespace sightline
