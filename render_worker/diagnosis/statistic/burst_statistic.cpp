// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/burst_statistic.h"

#include <algorithm>
#include <cmath>

#include "render_worker/sensor/expose.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

namespace {

// Gaussian noise for Poisson noise, and speckle that does not quite cancel where it is cut off.
constexpr double kBurstModelError = 2e-4;

std::vector<double> RowMeans(const Image<uint16_t>& raw) {
  std::vector<double> means(raw.rows_px, 0);
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int c = 0; c < raw.columns_px; ++c) means[row] += raw.At(row, c);
    means[row] /= std::max(1, raw.columns_px);
  }
  return means;
}

// Of the model: both columns of a Bayer cell, all strips.
std::vector<double> RowMeans(const ExpectedSet& expected, int f) {
  std::vector<double> means(expected.strips.front()[f].noise_variance_dn2.rows_px, 0);
  for (const std::vector<ExpectedFrame>& strips : expected.strips) {
    for (size_t row = 0; row < means.size(); ++row) {
      for (int c = 0; c < 2; ++c) {
        means[row] += strips[f].MeanDn(static_cast<int>(row), c) /
                      static_cast<double>(2 * expected.strips.size());
      }
    }
  }
  return means;
}

// Least-squares slope against `cause`: weights of the rows whose sum is 0.
std::vector<double> SlopeWeights(std::vector<double> cause) {
  double mean = 0;
  for (double value : cause) mean += value / static_cast<double>(cause.size());
  double square = 0;
  for (double& value : cause) {
    value -= mean;
    square += value * value;
  }
  for (double& value : cause) value = square > 0 ? value / square : 0;
  return cause;
}

double Contrast(const std::vector<double>& weights, const std::vector<double>& rows) {
  double sum = 0;
  for (size_t row = 0; row < std::min(weights.size(), rows.size()); ++row) {
    sum += weights[row] * rows[row];
  }
  return sum;
}

}  // namespace

BurstStatistic::BurstStatistic(const RecordedSet& set) {
  for (int f = 1; f < static_cast<int>(set.frames.size()); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    Entry entry;
    entry.seen = f;
    entry.preceding = PrecedingFrame(set, f);
    entry.columns_px = recorded.nominal.roi.columns_px;
    if (entry.preceding < 0) continue;
    if (recorded.plate_position_id < 0) {
      if (set.frames[entry.preceding].plate_position_id < 0) continue;
      entry.frames = {entry.preceding, f};
    } else {
      // The first recording of the same.
      for (int other = 0; other < f && entry.compared < 0; ++other) {
        const RecordedFrame& earlier = set.frames[other];
        if (earlier.plate_position_id == recorded.plate_position_id &&
            earlier.repeat_group == recorded.repeat_group) {
          entry.compared = other;
        }
      }
      if (entry.compared < 0) continue;
      entry.preceding_compared = PrecedingFrame(set, entry.compared);
      const auto exposure = [&](int frame) {
        return frame < 0 ? 0 : set.frames[frame].nominal.exposure_time_s;
      };
      // Frames of the same brightness leave the same.
      if (exposure(entry.preceding) < 1.5 * exposure(entry.preceding_compared)) continue;
      entry.frames = {entry.compared, entry.preceding, f};
      if (entry.preceding_compared >= 0) entry.frames.push_back(entry.preceding_compared);
      std::sort(entry.frames.begin(), entry.frames.end());
      entry.frames.erase(std::unique(entry.frames.begin(), entry.frames.end()), entry.frames.end());
    }
    if (!recorded.raw_dn.empty()) {
      std::vector<double> cause = RowMeans(set.frames[entry.preceding].raw_dn);
      if (entry.preceding_compared >= 0) {
        const std::vector<double> other = RowMeans(set.frames[entry.preceding_compared].raw_dn);
        for (size_t row = 0; row < cause.size(); ++row) cause[row] -= other[row];
      }
      entry.weights = SlopeWeights(std::move(cause));
    }
    entries_.push_back(std::move(entry));
  }
}

std::vector<double> BurstStatistic::Weights(const ExpectedSet& expected, const Entry& entry) const {
  if (!entry.weights.empty()) return entry.weights;
  std::vector<double> cause = RowMeans(expected, entry.preceding);
  if (entry.preceding_compared >= 0) {
    const std::vector<double> other = RowMeans(expected, entry.preceding_compared);
    for (size_t row = 0; row < cause.size(); ++row) cause[row] -= other[row];
  }
  return SlopeWeights(std::move(cause));
}

Eigen::VectorXd BurstStatistic::Observed(const RecordedSet& set, int index) const {
  const Entry& entry = entries_[index];
  double value = Contrast(entry.weights, RowMeans(set.frames[entry.seen].raw_dn));
  if (entry.compared >= 0) {
    value -= Contrast(entry.weights, RowMeans(set.frames[entry.compared].raw_dn));
  }
  return Eigen::VectorXd::Constant(1, value);
}

Eigen::VectorXd BurstStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const std::vector<double> weights = Weights(expected, entry);
  double value = Contrast(weights, RowMeans(expected, entry.seen));
  if (entry.compared >= 0) value -= Contrast(weights, RowMeans(expected, entry.compared));
  return Eigen::VectorXd::Constant(1, value);
}

Eigen::MatrixXd BurstStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const std::vector<double> weights = Weights(expected, entry);
  double variance = kBurstModelError * kBurstModelError;
  // What is left has the speckle of the frame before.
  const ExpectedFrame& lit = expected.strips.front()[entry.preceding];
  if (lit.speckle != nullptr) {
    std::vector<double> left = RowMeans(expected, entry.seen);
    std::vector<double> without(left.size(), DarkMeanDn(lit.frame.sensor));
    if (entry.compared >= 0) without = RowMeans(expected, entry.compared);
    for (size_t row = 0; row < left.size(); ++row) {
      left[row] = row < weights.size() ? weights[row] * (left[row] - without[row]) : 0;
    }
    variance += VarianceOfRows(*lit.speckle, left, static_cast<int>(entry.columns_px), 1,
                               lit.frame.roi.row_px, lit.frame.sensor.pixel_pitch_m);
  }
  for (int f : {entry.seen, entry.compared}) {
    if (f < 0) continue;
    for (const std::vector<ExpectedFrame>& strips : expected.strips) {
      for (size_t row = 0; row < weights.size(); ++row) {
        for (int c = 0; c < 2; ++c) {
          const int r = static_cast<int>(row);
          // Fixed patterns cancel between repeats.
          const double noise =
              strips[f].noise_variance_dn2.At(r, c) +
              (entry.compared < 0 ? strips[f].pattern_variance_dn2.At(r, c) : 0.0F);
          variance += weights[row] * weights[row] * noise /
                      (entry.columns_px * 2 * static_cast<double>(expected.strips.size()));
        }
      }
    }
  }
  return Eigen::MatrixXd::Constant(1, 1, variance);
}

}  // namespace sightline
