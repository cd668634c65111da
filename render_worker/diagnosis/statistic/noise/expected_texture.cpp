// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/noise/expected_texture.h"

#include <cmath>
#include <cstdlib>

#include "render_worker/diagnosis/statistic/noise/bin_moments.h"
#include "render_worker/recordings/strips.h"

namespace sightline {

namespace {

// Sum over a segment's columns of the speckle correlation with one of them, over their number: the
// fraction of the variance that the mean of the segment removes.
double MeanShare(const SpecklePixelCovariance& speckle, int columns, int step) {
  return CovarianceOfMeans(speckle, 0, columns, step, 0) / speckle.At(0, 0);
}

// Relative variance of the laser light along the segment of a sample.
double VarianceAlongLine(const ExpectedFrame& sample) {
  double sum = 0;
  for (double level : sample.level_along_line) sum += (level - 1) * (level - 1);
  const double known = sample.level_along_line.empty() ? 0 : sum / sample.level_along_line.size();
  return known + sample.drawn_variance_along_line;
}

// Variance of the expectation of a row's pixels where odd and even columns of the plane differ.
double VarianceOfAlternation(const ExpectedFrame& sample, int row, const PixelPlane& plane) {
  if (plane.step > 1 || sample.mean_dn.columns_px < 2) return 0;
  const double half_difference = (sample.MeanDn(row, 1) - sample.MeanDn(row, 0)) / 2;
  return half_difference * half_difference;
}

}  // namespace

int OtherRow(int row, int lag, int rows_px) { return row + lag < rows_px ? row + lag : row - lag; }

ExpectedTexture::ExpectedTexture(const ExpectedSet& expected, int frame, int columns, int step,
                                 double black_dn)
    : expected_(expected),
      frame_(frame),
      columns_(columns),
      step_(step),
      black_dn_(black_dn),
      front_(expected.strips.front()[frame]) {
  if (front_.speckle == nullptr) return;
  for (int place = 0; place < front_.speckle->places(); ++place) {
    shares_.push_back(MeanShare(front_.speckle->At(place), columns, step));
  }
}

double ExpectedTexture::BackgroundVariance(const PixelPlane& plane, const ProfileBin& bin) const {
  double sum = 0;
  for (int row : bin.rows) sum += AboutMean(MomentsOf(plane, row), ShareOf(row));
  return sum / static_cast<double>(bin.rows.size());
}

CoreSums ExpectedTexture::Core(const std::vector<PixelPlane>& planes,
                               const std::vector<ProfileBin>& core) const {
  CoreSums sums;
  for (const ProfileBin& bin : core) {
    double signal = 0;
    for (int row : bin.rows) signal += AddRow(planes[bin.plane], row, sums);
    const double count = static_cast<double>(bin.rows.size());
    sums.square += signal * signal / count;
  }
  return sums;
}

// Fraction of the speckle's variance that the mean of the segment removes.
double ExpectedTexture::ShareOf(int row) const {
  if (front_.speckle == nullptr) return 0;
  return shares_[front_.speckle->PlaceOf((front_.frame.roi.row_px + row) *
                                         front_.frame.sensor.pixel_pitch_m)];
}

RowMoments ExpectedTexture::MomentsOf(const PixelPlane& plane, int row) const {
  const int segments = static_cast<int>(expected_.strips.size());
  RowMoments moments;
  for (const std::vector<ExpectedFrame>& samples : expected_.strips) {
    const ExpectedFrame& sample = samples[frame_];
    const double along = VarianceAlongLine(sample);
    const double signal = MeanOfColumns(sample.mean_dn, row, plane) - black_dn_;
    // Light that varies along the line raises the mean of squared speckle.
    moments.level += (1 + along) * MeanOfColumns(sample.level_variance_dn2, row, plane) / segments;
    moments.noise += PixelVariance(sample, row, plane) / segments;
    moments.signal += signal / segments;
    moments.along += along * signal * signal / segments;
    moments.alternation += VarianceOfAlternation(sample, row, plane) / segments;
  }
  return moments;
}

// Variance about the mean of the segment, without that of light along the line.
double ExpectedTexture::AboutMean(const RowMoments& row, double share) const {
  return row.level * (1 - share) + row.noise * (1 - 1.0 / columns_) + row.alternation;
}

// Adds the variance and correlations of a row; returns its signal.
double ExpectedTexture::AddRow(const PixelPlane& plane, int row, CoreSums& sums) const {
  const RowMoments moments = MomentsOf(plane, row);
  const SpecklePixelCovariance& speckle = front_.SpeckleAt(row, plane.first_column);
  const double one = speckle.At(0, 0), share = ShareOf(row);
  const double here = AboutMean(moments, share) + moments.along;
  sums.variance += here;
  ++sums.rows;
  for (int lag = 1; lag <= kCorrelationLags; ++lag) {
    // Neighbours alternate: the sign changes with every column.
    const double alternation = lag % 2 != 0 ? -moments.alternation : moments.alternation;
    sums.correlations[2 * lag - 2] += (moments.level * (speckle.At(0, lag * step_) / one - share) -
                                       moments.noise / columns_ + moments.along + alternation) /
                                      here;
    sums.correlations[2 * lag - 1] += CorrelationAcross(plane, row, lag, moments, here, one);
  }
  return moments.signal;
}

// Correlation of a pixel with the one `lag` pixels further across the line. `one`: variance of
// the row's speckle in the units of its covariance function.
double ExpectedTexture::CorrelationAcross(const PixelPlane& plane, int row, int lag,
                                          const RowMoments& moments, double here,
                                          double one) const {
  const int rows_px = front_.noise_variance_dn2.rows_px;
  const int other = OtherRow(row, lag * step_, rows_px);
  const RowMoments moments_there = MomentsOf(plane, other);
  const double there = AboutMean(moments_there, ShareOf(other)) + moments_there.along;
  // The covariance of two rows is taken midway between them.
  const SpecklePixelCovariance& between =
      front_.SpeckleAt(step_ > 1 ? row : (row + other) / 2, plane.first_column);
  const double both = std::sqrt(one * front_.SpeckleAt(other, plane.first_column).At(0, 0));
  double row_share = 0;
  for (int c = -columns_ + 1; c < columns_; ++c) {
    row_share += (1 - std::abs(c) / static_cast<double>(columns_)) *
                 between.At(lag * step_, c * step_) / (both * columns_);
  }
  return (std::sqrt(moments.level * moments_there.level) *
              (between.At(lag * step_, 0) / both - row_share) +
          std::sqrt(moments.along * moments_there.along) +
          std::sqrt(moments.alternation * moments_there.alternation)) /
         std::sqrt(here * there);
}

}  // namespace sightline
