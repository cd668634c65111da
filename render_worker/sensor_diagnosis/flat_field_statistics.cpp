// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <functional>

#include "core/statistics/square.h"

namespace sightline {
namespace {

// Parts of the image per side; standard errors come from the differences between parts. 64 parts
// determine a standard error to 9 %.
constexpr int kPartsPerSide = 8;

double Mean(const Image<uint16_t>& frame) {
  uint64_t sum = 0;
  for (const uint16_t value : frame.values) sum += value;
  return static_cast<double>(sum) / static_cast<double>(frame.values.size());
}

// Mean over the parts and its standard error.
Estimate OverParts(const std::vector<double>& values) {
  const double n = static_cast<double>(values.size());
  double mean = 0, squares = 0;
  for (const double value : values) mean += value / n;
  for (const double value : values) squares += Square(value - mean);
  return {mean, std::sqrt(squares / (n - 1) / n)};
}

double MeanOf(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

double FlatFieldStatistics::MeanDn() const { return MeanOf(frame_mean_dn); }

FlatFieldAccumulator::FlatFieldAccumulator(double largest_dn, bool keep_mean)
    : largest_dn_(largest_dn),
      keep_mean_(keep_mean),
      parts_(size_t{kPartsPerSide} * kPartsPerSide) {}

void FlatFieldAccumulator::AddDifference(const Image<uint16_t>& a, const Image<uint16_t>& b,
                                         int apart) {
  const double shift = Mean(a) - Mean(b);
  std::vector<double> difference(columns_), above(columns_), column_sum(columns_, 0);
  double row_mean_square = 0;
  for (int row = 0; row < rows_; ++row) {
    double row_sum = 0;
    for (int column = 0; column < columns_; ++column) {
      difference[column] = static_cast<double>(a.At(row, column)) - b.At(row, column) - shift;
      row_sum += difference[column];
      column_sum[column] += difference[column];
    }
    const int part_row = row * kPartsPerSide / rows_ * kPartsPerSide;
    for (int column = 0; column < columns_; ++column) {
      PartSums& part = parts_[part_row + column * kPartsPerSide / columns_];
      const double d = difference[column];
      part.squares[apart - 1] += d * d;
      part.count[apart - 1] += 1;
      if (apart != 1) continue;
      if (column > 0) {
        part.in_row += d * difference[column - 1];
        part.pairs_in_row += 1;
      }
      if (row > 0) {
        part.in_column += d * above[column];
        part.pairs_in_column += 1;
      }
    }
    row_mean_square += Square(row_sum / columns_) / rows_;
    std::swap(difference, above);
  }
  if (apart != 1) return;
  double column_mean_square = 0;
  for (const double sum : column_sum) column_mean_square += Square(sum / rows_) / columns_;
  row_mean_squares_.push_back(row_mean_square);
  column_mean_squares_.push_back(column_mean_square);
}

void FlatFieldAccumulator::Add(const Image<uint16_t>& frame_dn) {
  if (frame_mean_dn_.empty()) {
    rows_ = frame_dn.rows_px;
    columns_ = frame_dn.columns_px;
    if (keep_mean_) sum_ = Image<double>(columns_, rows_);
  }
  assert(frame_dn.rows_px == rows_ && frame_dn.columns_px == columns_);
  assert(rows_ >= kPartsPerSide && columns_ >= kPartsPerSide);
  frame_mean_dn_.push_back(Mean(frame_dn));
  for (size_t i = 0; i < frame_dn.values.size(); ++i) {
    at_zero_ += frame_dn.values[i] == 0;
    at_largest_ += frame_dn.values[i] >= largest_dn_;
    if (frame_dn.values[i] > largest_seen_dn_) {
      largest_seen_dn_ = frame_dn.values[i];
      at_largest_seen_ = 0;
    }
    at_largest_seen_ += frame_dn.values[i] == largest_seen_dn_;
    if (keep_mean_) sum_.values[i] += frame_dn.values[i];
  }
  if (frame_mean_dn_.size() == 2) pair_ = StatisticsOfPair(last_.front(), frame_dn);
  for (size_t i = 0; i < last_.size(); ++i) {
    AddDifference(frame_dn, last_[i], static_cast<int>(i) + 1);
  }
  last_.push_front(frame_dn);
  if (last_.size() > 3) last_.pop_back();
}

FlatFieldStatistics FlatFieldAccumulator::Finish() const {
  assert(pair_);
  FlatFieldStatistics result;
  result.pair = *pair_;
  result.frame_mean_dn = frame_mean_dn_;
  const double frames = static_cast<double>(frame_mean_dn_.size());
  const double pixels = static_cast<double>(rows_) * columns_;
  result.share_at_zero = at_zero_ / frames / pixels;
  result.share_at_largest = at_largest_ / frames / pixels;
  result.largest_seen_dn = largest_seen_dn_;
  result.share_at_largest_seen = at_largest_seen_ / frames / pixels;
  const auto over_parts = [&](const std::function<double(const PartSums&)>& value) {
    std::vector<double> values;
    for (const PartSums& part : parts_) values.push_back(value(part));
    return OverParts(values);
  };
  std::optional<Estimate>* variances[3] = {&result.noise.variance_1_apart_dn2,
                                           &result.noise.variance_2_apart_dn2,
                                           &result.noise.variance_3_apart_dn2};
  for (int k = 0; k < 3 && k + 2 <= frames; ++k) {
    *variances[k] =
        over_parts([k](const PartSums& part) { return part.squares[k] / part.count[k] / 2; });
  }
  TemporalNoise& noise = result.noise;
  noise.covariance_in_row_dn2 =
      over_parts([](const PartSums& part) { return part.in_row / part.pairs_in_row / 2; });
  noise.covariance_in_column_dn2 =
      over_parts([](const PartSums& part) { return part.in_column / part.pairs_in_column / 2; });
  // Without noise of whole rows the mean of n pixels has 1/n of a pixel's variance, and (1 + 2 rho)
  // times as much if neighbours have the correlation rho. Consecutive differences share a frame, so
  // only half of them are independent.
  const double variance = noise.variance_1_apart_dn2->value;
  const double differences = std::max(1.0, frames / 2);
  const double row_square = MeanOf(row_mean_squares_) / 2;
  const double column_square = MeanOf(column_mean_squares_) / 2;
  noise.row_variance_dn2 = {
      row_square - (variance + 2 * noise.covariance_in_row_dn2.value) / columns_,
      row_square * std::sqrt(2 / (rows_ * differences))};
  noise.column_variance_dn2 = {
      column_square - (variance + 2 * noise.covariance_in_column_dn2.value) / rows_,
      column_square * std::sqrt(2 / (columns_ * differences))};
  if (keep_mean_) {
    result.mean_dn = sum_;
    for (double& value : result.mean_dn.values) value /= frames;
  }
  return result;
}

}  // namespace sightline
