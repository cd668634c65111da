// SPDX-License-Identifier: Apache-2.0
// Variance and correlation of the pixels of a recorded line, as TextureStatistic measures them and
// as the model expects them.
#pragma once

#include <array>
#include <vector>

#include "render_worker/diagnosis/statistic/set_statistic.h"
#include "render_worker/recordings/profile_bins.h"

namespace sightline {

// Lags of the correlations [pixels of the plane]. Chosen: speckle is one to two pixels large.
inline constexpr int kCorrelationLags = 2;
inline constexpr int kCoreValues = 1 + 2 * kCorrelationLags;

// The row `lag` rows below, or above at the region's end.
int OtherRow(int row, int lag, int rows_px);

// Sums over the rows of one plane's core.
struct CoreSums {
  double variance = 0;  // of the pixels about the mean of their segment and row [DN^2]
  double square = 0;    // squared signal [DN^2]
  double rows = 0;
  std::array<double, size_t{2} * kCorrelationLags> correlations{};  // along, across, by lag

  double SquaredContrast() const { return variance / square; }
};

// Expected second moments of the pixels of one row, averaged over the segments along the line.
struct RowMoments {
  double level = 0, noise = 0;  // variance by speckle, by noise and fixed pattern [DN^2]
  double signal = 0;            // mean above dark [DN]
  double along = 0;             // variance of light that changes slowly along the line [DN^2]
  double alternation = 0;       // variance by a difference of odd and even columns [DN^2]
};

// Expected variances and correlations of the pixels of one recording.
class ExpectedTexture {
 public:
  // `columns`: pixels of one plane in a row of a segment, `step` columns apart; `black_dn`: mean in
  // the dark. `expected` must outlive this.
  ExpectedTexture(const ExpectedSet& expected, int frame, int columns, int step, double black_dn);

  // Variance of a bin's pixels about the means of their segment and row [DN^2].
  double BackgroundVariance(const PixelPlane& plane, const ProfileBin& bin) const;
  CoreSums Core(const std::vector<PixelPlane>& planes, const std::vector<ProfileBin>& core) const;

 private:
  double ShareOf(int row) const;
  RowMoments MomentsOf(const PixelPlane& plane, int row) const;
  double AboutMean(const RowMoments& row, double share) const;
  double AddRow(const PixelPlane& plane, int row, CoreSums& sums) const;
  double CorrelationAcross(const PixelPlane& plane, int row, int lag, const RowMoments& moments,
                           double here, double one) const;

  const ExpectedSet& expected_;
  int frame_;
  int columns_, step_;
  double black_dn_;
  const ExpectedFrame& front_;
  std::vector<double> shares_;  // by position across the line
};

}  // namespace sightline
