// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/noise/dark_statistic.h"

#include <algorithm>
#include <cmath>

#include "core/statistics/order_statistics.h"
#include "render_worker/diagnosis/statistic/noise/bin_moments.h"

namespace sightline {

namespace {

constexpr int kDarkFrameValues = 4;
// An outlier lies further from the median than this many standard deviations. Chosen: normal noise
// has none in any image (1e-15 per pixel).
constexpr double kOutlierDeviations = 8;
// Interquartile range of the standard normal distribution.
constexpr double kInterquartileRange = 1.349;
// Least standard deviation [DN]. Chosen: that of values that rounding makes equal is up to half a
// raw value.
constexpr double kLeastDeviation_dn = 0.5;

// Fraction of pixels that are outliers. The interquartile range estimates the standard deviation,
// because outliers do not change it.
double OutlierShare(const Image<uint16_t>& raw) {
  std::vector<uint16_t> sorted = raw.values;
  std::sort(sorted.begin(), sorted.end());
  const double median = QuantileBeforeRounding(sorted, 0.5);
  const double quartiles =
      QuantileBeforeRounding(sorted, 0.75) - QuantileBeforeRounding(sorted, 0.25);
  const double spread = std::max(kLeastDeviation_dn, quartiles / kInterquartileRange);
  double outliers = 0;
  for (uint16_t value : raw.values) {
    outliers += std::abs(value - median) > kOutlierDeviations * spread ? 1 : 0;
  }
  return outliers / static_cast<double>(raw.values.size());
}

// Variance between columns because odd and even ones differ [DN^2].
double VarianceBetweenColumns(const ExpectedSet& expected, int frame) {
  if (!ColumnsAlternate(expected.effects)) return 0;
  double difference = 0, rows = 0;
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    const ExpectedFrame& sample = samples[frame];
    if (sample.mean_dn.columns_px < 2) return 0;
    for (int row = 0; row < sample.mean_dn.rows_px; ++row, ++rows) {
      difference += sample.MeanDn(row, 1) - sample.MeanDn(row, 0);
    }
  }
  difference /= rows;
  return difference * difference / 4;
}

}  // namespace

DarkStatistic::DarkStatistic(const RecordedSet& set) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    if (set.frames[f].plate_position_id >= 0) continue;
    // BurstStatistic evaluates image lag after a lit frame. Here it would count as noise.
    const int before = PrecedingFrame(set, static_cast<int>(f));
    if (before >= 0 && set.frames[before].plate_position_id >= 0) continue;
    frames_.push_back({static_cast<int>(f)});
    const RegionOfInterest& roi = set.frames[f].nominal.roi;
    sizes_px_.emplace_back(roi.columns_px, roi.rows_px);
  }
}

Eigen::VectorXd DarkStatistic::Observed(const RecordedSet& set, int block) const {
  const Image<uint16_t>& raw = set.frames[frames_[block].front()].raw_dn;
  std::vector<double> row_means(raw.rows_px, 0), column_means(raw.columns_px, 0);
  double mean = 0;
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int column = 0; column < raw.columns_px; ++column) {
      row_means[row] += static_cast<double>(raw.At(row, column)) / raw.columns_px;
      column_means[column] += static_cast<double>(raw.At(row, column)) / raw.rows_px;
    }
    mean += row_means[row] / raw.rows_px;
  }
  const auto variance = [&](const std::vector<double>& values) {
    double sum = 0;
    for (double value : values) sum += (value - mean) * (value - mean);
    return sum / static_cast<double>(values.size() - 1);
  };
  double pixels = 0;
  for (uint16_t value : raw.values) pixels += (value - mean) * (value - mean);
  pixels /= static_cast<double>(raw.values.size() - 1);
  Eigen::VectorXd values(kDarkFrameValues);
  values << pixels, variance(row_means), variance(column_means), OutlierShare(raw);
  return values;
}

Eigen::VectorXd DarkStatistic::Expected(const ExpectedSet& expected, int block) const {
  const int f = frames_[block].front();
  const auto [columns, rows] = sizes_px_[block];
  double independent = 0, fixed_mean = 0, fixed_square = 0, count = 0;
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    const ExpectedFrame& sample = samples[f];
    for (int row = 0; row < sample.noise_variance_dn2.rows_px; ++row) {
      for (int column = 0; column < sample.noise_variance_dn2.columns_px; ++column) {
        independent +=
            sample.noise_variance_dn2.At(row, column) + sample.pattern_variance_dn2.At(row, column);
        const double mean = sample.MeanDn(row, column);
        fixed_mean += mean;
        fixed_square += mean * mean;
        ++count;
      }
    }
  }
  independent /= count;
  fixed_mean /= count;
  const double pixels = independent + std::max(0.0, fixed_square / count - fixed_mean * fixed_mean);
  Eigen::VectorXd values(kDarkFrameValues);
  const ExpectedFrame& any = expected.strips.front()[f];
  const double of_rows = any.row_scatter_dn * any.row_scatter_dn;
  const double of_columns = any.column_scatter_dn * any.column_scatter_dn;
  // The random offset of a row remains in the row's mean. It is equal in the means of all columns
  // and adds nothing to their variance; the same holds for columns. A difference of odd and even
  // columns is in the pixels' variance already, and remains in the columns' means.
  const double alternation = VarianceBetweenColumns(expected, f);
  const double others = pixels - alternation;
  values << pixels + of_rows + of_columns, others / columns + of_rows,
      others / rows + of_columns + alternation, 0;
  return values;
}

Eigen::MatrixXd DarkStatistic::Covariance(const ExpectedSet& expected, int block) const {
  const auto [columns, rows] = sizes_px_[block];
  const Eigen::VectorXd values = Expected(expected, block);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kDarkFrameValues, kDarkFrameValues);
  const double pixels = static_cast<double>(columns) * rows;
  // A variance of n independent values has a relative variance of (2 + excess kurtosis) / n.
  covariance(1, 1) = values[1] * values[1] * 2 / rows;
  covariance(2, 2) = values[2] * values[2] * 2 / columns;
  // The variance of the pixels contains that of the row means and of the column means.
  const double kurtosis = expected.strips.front()[frames_[block].front()].NoiseExcessKurtosis(0, 0);
  covariance(0, 0) =
      values[0] * values[0] * (2 + kurtosis) / pixels + covariance(1, 1) + covariance(2, 2);
  covariance(0, 1) = covariance(1, 0) = covariance(1, 1);
  covariance(0, 2) = covariance(2, 0) = covariance(2, 2);
  // Standard deviation of the outliers: half a pixel. Chosen: none is expected.
  covariance(3, 3) = 0.25 / (pixels * pixels);
  return covariance;
}

}  // namespace sightline
