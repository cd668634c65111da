// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/profile_covariance.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/statistic/profile_model_error.h"
#include "render_worker/recordings/strips.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

namespace {

// Levels above this fraction of the largest raw value are cut off by saturation.
constexpr double kCutOff = 0.99;
// Relative error of the mean where saturation cuts off half of the speckle. Chosen: speckle there
// is not exactly Gamma distributed.
constexpr double kSaturationError = 0.01;

// Correlation of the means of two rows over a segment's columns, for one plane of the colour
// filter.
class RowMeanCorrelation {
 public:
  // `columns`: pixels of the plane in a row of the segment, `step` columns apart.
  RowMeanCorrelation(const LineSpeckle& line, const FrameSetup& frame, int columns, int step)
      : line_(line), frame_(frame), distances_(2 * line.max_lag() + 1) {
    correlation_.resize(static_cast<size_t>(line.places()) * distances_ * kPhases);
    for (int place = 0; place < line.places(); ++place) {
      const SpecklePixelCovariance& pixel = line.At(place);
      for (int dr = -max_lag(); dr <= max_lag(); ++dr) {
        for (int phase = -1; phase <= 1; ++phase) {
          correlation_[Index(place, dr, phase)] =
              CovarianceOfMeans(pixel, dr, columns, step, phase) / pixel.At(0, 0);
        }
      }
    }
  }

  int max_lag() const { return line_.max_lag(); }

  // Index of the row's position across the line, for At.
  int PlaceOf(int row) const {
    return line_.PlaceOf((frame_.roi.row_px + row) * frame_.sensor.pixel_pitch_m);
  }

  // Correlation of rows `distance` apart, by the speckle at a position across the line. `phase`:
  // -1, 0 or 1, columns between the planes of the two.
  double At(int place, int distance, int phase) const {
    return correlation_[Index(place, distance, phase)];
  }

 private:
  static constexpr int kPhases = 3;
  size_t Index(int place, int distance, int phase) const {
    return (static_cast<size_t>(place) * distances_ + distance + max_lag()) * kPhases + phase + 1;
  }

  const LineSpeckle& line_;
  const FrameSetup& frame_;
  int distances_;
  std::vector<double> correlation_;
};

// A row of a bin at the segment's middle: deviation of every level of speckle from the mean [DN].
struct RowLevels {
  int component, row, plane;
  int place;      // of RowMeanCorrelation
  double weight;  // of the row in its bin
  std::vector<double> deviation;
};

struct BinVariances {
  Eigen::VectorXd noise, saturation;  // of every component [DN^2]
  std::vector<RowLevels> rows;        // without laser light: none
};

// Variance of a bin's mean because the model is inaccurate where speckle saturates in part. It is
// largest where half of the levels are cut off.
double SaturationVariance(const ExpectedFrame& sample, size_t levels, double top_dn, int row,
                          int column) {
  double cut_off = 0;  // fraction of the levels
  for (const Image<float>& level : sample.level_dn) {
    cut_off += (level.At(row, column) > top_dn) / static_cast<double>(levels);
  }
  return std::pow(kSaturationError * top_dn * 4 * cut_off * (1 - cut_off), 2);
}

// Collects a bin's rows; returns the sum of their noise variances.
double AddRows(const ExpectedFrame& sample, size_t levels, const ProfileBin& bin, int column,
               int component, int sharing, std::vector<RowLevels>& rows) {
  const double weight = 1.0 / static_cast<double>(bin.rows.size());
  double noise = 0;
  for (int row : bin.rows) {
    // The fixed pattern is the same in all groups that see these pixels. It must count once in all
    // of them together, so its variance is multiplied by their number.
    noise += sample.noise_variance_dn2.At(row, column) +
             sharing * sample.pattern_variance_dn2.At(row, column);
    if (levels < 2) continue;
    RowLevels of_row{component, row, bin.plane, 0, weight, std::vector<double>(levels)};
    const double mean = sample.MeanDn(row, column);
    for (size_t q = 0; q < levels; ++q) {
      of_row.deviation[q] = sample.level_dn[q].At(row, column) - mean;
    }
    rows.push_back(std::move(of_row));
  }
  return noise;
}

BinVariances VariancesOfBins(const ProfileGroup& group, const std::vector<PixelPlane>& planes,
                             const std::vector<ExpectedFrame>& samples, int columns_px) {
  BinVariances variances{Eigen::VectorXd::Zero(group.size), Eigen::VectorXd::Zero(group.size), {}};
  const ExpectedFrame& front = samples[group.frames.front()];
  const int middle = front.noise_variance_dn2.columns_px / 4 * 2;
  const size_t levels = front.level_dn.size();
  const double top_dn = kCutOff * front.frame.sensor.largest_dn();
  int component = 0;
  for (size_t m = 0; m < group.frames.size(); ++m) {
    const ExpectedFrame& sample = samples[group.frames[m]];
    for (const ProfileBin& bin : group.bins[m]) {
      const PixelPlane& plane = planes[bin.plane];
      const int columns = (columns_px - plane.first_column + plane.step - 1) / plane.step;
      const double weight = 1.0 / static_cast<double>(bin.rows.size());
      const int column = middle + plane.first_column;
      const double noise =
          AddRows(sample, levels, bin, column, component, group.sharing, variances.rows);
      variances.saturation[component] =
          SaturationVariance(sample, levels, top_dn, bin.rows[bin.rows.size() / 2], column);
      variances.noise[component++] = noise * weight * weight / columns +
                                     std::pow(sample.row_scatter_dn, 2) * weight +
                                     std::pow(sample.column_scatter_dn, 2) / columns;
    }
  }
  return variances;
}

// Adds the covariance by speckle: that of the levels of two rows, times the correlation of the
// means of these rows.
void AddSpeckle(const RowMeanCorrelation& correlation, const std::vector<PixelPlane>& planes,
                std::vector<RowLevels>& rows, Eigen::MatrixXd& covariance) {
  for (RowLevels& each : rows) each.place = correlation.PlaceOf(each.row);
  // Sorted, so that only rows within the range of the correlation are compared.
  std::stable_sort(rows.begin(), rows.end(),
                   [](const RowLevels& a, const RowLevels& b) { return a.row < b.row; });
  for (size_t i = 0; i < rows.size(); ++i) {
    const RowLevels& a = rows[i];
    for (size_t j = i; j < rows.size() && rows[j].row - a.row <= correlation.max_lag(); ++j) {
      const RowLevels& b = rows[j];
      const int phase = planes[b.plane].first_column - planes[a.plane].first_column;
      const int distance = b.row - a.row;
      // The mean of both rows' statistics keeps the matrix symmetric.
      const double factor = 0.5 * (correlation.At(a.place, distance, phase) +
                                   correlation.At(b.place, distance, phase));
      const size_t levels = a.deviation.size();
      double product = 0;
      for (size_t q = 0; q < levels; ++q) product += a.deviation[q] * b.deviation[q];
      const double value = product / static_cast<double>(levels) * factor * a.weight * b.weight;
      covariance(a.component, b.component) += value;
      if (i != j) covariance(b.component, a.component) += value;
    }
  }
}

// Makes a matrix with these variances positive definite. Correlations composed of positions with
// different statistics need not be; they are then lowered by a common factor.
void MakePositive(Eigen::MatrixXd& covariance) {
  // Chosen: steps of a tenth down to a twentieth, below which the diagonal is left. Tests for
  // positive definiteness have the variances raised by one per cent, because model errors are added
  // to them anyway.
  constexpr double kLowering = 0.9, kLowest = 0.05, kRaisedVariance = 1.01;
  constexpr double kLeastVariance_dn2 = 1e-30;
  const Eigen::VectorXd deviation = covariance.diagonal().cwiseMax(kLeastVariance_dn2).cwiseSqrt();
  const Eigen::VectorXd inverse = deviation.cwiseInverse();
  const Eigen::MatrixXd correlation = inverse.asDiagonal() * covariance * inverse.asDiagonal();
  for (double part = 1; part > kLowest; part *= kLowering) {
    Eigen::MatrixXd lowered = part * correlation;
    lowered.diagonal().setConstant(kRaisedVariance);
    if (lowered.llt().info() != Eigen::Success) continue;
    if (part == 1) return;
    lowered.diagonal().setOnes();
    covariance = deviation.asDiagonal() * lowered * deviation.asDiagonal();
    return;
  }
  covariance = Eigen::MatrixXd(covariance.diagonal().asDiagonal());
}

// Standard deviations of the image lag in a dark frame [DN]. It has the speckle of the lit frame
// before.
Eigen::VectorXd ErrorOfImageLag(const ProfileGroup& group, const std::vector<PixelPlane>& planes,
                                const std::vector<ExpectedFrame>& samples, int columns, int step) {
  Eigen::VectorXd error = Eigen::VectorXd::Zero(group.size);
  const ExpectedFrame& lit = samples[group.preceding];
  const ExpectedFrame& dark = samples[group.frames.front()];
  if (lit.speckle == nullptr) return error;
  const FrameSetup& frame = dark.frame;
  Eigen::Index component = 0;
  for (const ProfileBin& bin : group.bins.front()) {
    std::vector<double> lag_dn(frame.roi.rows_px, 0);
    for (int row : bin.rows) {
      lag_dn[row] = frame.sensor.gain_dn_per_electron *
                    dark.mean_photo_electrons.At(row, planes[bin.plane].first_column) /
                    static_cast<double>(bin.rows.size());
    }
    error[component++] = std::sqrt(VarianceOfRows(*lit.speckle, lag_dn, columns, step,
                                                  frame.roi.row_px, frame.sensor.pixel_pitch_m));
  }
  return error;
}

}  // namespace

Eigen::MatrixXd ProfileCovariance(const ProfileGroup& group, const std::vector<PixelPlane>& planes,
                                  const std::vector<ExpectedFrame>& samples, int columns_px,
                                  int segments, const Eigen::VectorXd& means) {
  const ExpectedFrame& front = samples[group.frames.front()];
  BinVariances variances = VariancesOfBins(group, planes, samples, columns_px);
  const int step = planes.front().step;
  const int columns = columns_px / step;
  if (front.level_dn.size() < 2) {
    Eigen::MatrixXd covariance = variances.noise.asDiagonal();
    if (group.preceding >= 0) {
      const Eigen::VectorXd lag = ErrorOfImageLag(group, planes, samples, columns, step);
      covariance += lag * lag.transpose();
    }
    return covariance;
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(group.size, group.size);
  const RowMeanCorrelation correlation(*front.speckle, front.frame, columns, step);
  AddSpeckle(correlation, planes, variances.rows, covariance);
  MakePositive(covariance);
  AddModelErrors(means, group, segments, variances.noise, variances.saturation, covariance);
  return covariance;
}

}  // namespace sightline
