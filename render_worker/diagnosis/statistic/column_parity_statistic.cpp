// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/column_parity_statistic.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdlib>
#include <numbers>
#include <utility>

#include "render_worker/recordings/strips.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Least signal of a lit row, relative to the largest raw value. Chosen: above dark noise.
constexpr double kLitRow = 0.02;
// A pixel above this fraction of the largest raw value is saturated, and a recording with more than
// the given fraction of such pixels is left out. Below, the expectation is cut off alike.
constexpr double kSaturatedPixel = 0.99, kMostSaturated = 0.01;
// Least width of a region. Chosen: the window is then smooth against an alternation.
constexpr int kLeastWindow_px = 32;
// Columns and speckle levels of the sample that a planned recording is judged by. Chosen: its mean
// suffices.
constexpr int kJudgedColumns_px = 2, kJudgedLevels = 8;
// Error of the expectation that all recordings have in common. Chosen: smaller than gains that
// matter; rendered sets without effects show none.
constexpr double kCommonError = 3e-4;
// Relative error of what a narrow line contributes to a Bayer sensor's contrast. Chosen: 2 % of the
// width and 0.03 pixels of the place of a line of a pixel's width change it by as much.
constexpr double kSamplingError = 0.1;
// Fraction of the differences between the segments that is uncertain, because a sample stands for
// its segment. Chosen: a line that is not straight moves by as much within segments as between
// them.
constexpr double kSegmentError = 0.5;
// Frequency at which the transform of the line is read, per row [1/px]. Chosen: near that of an
// alternation, 1/2, which odd and even columns themselves contribute to.
constexpr double kReadFrequency = 0.4;

bool IsCompared(const Sensor& sensor, const RegionOfInterest& roi, int row, int column) {
  return sensor.colour_filter == ColourFilter::kMono ||
         sensor.ChannelAt(roi.row_px + row, roi.column_px + column) == kGreen;
}

// 1 in odd columns of the sensor, 0 in even ones, also left of the principal point.
int ParityOf(const RegionOfInterest& roi, int column) { return (roi.column_px + column) & 1; }

// Weights of a region's columns: a Hann window over an even number of them.
std::vector<double> ParityWindow(int columns_px) {
  std::vector<double> window(columns_px, 0.0);
  const int even = columns_px / 2 * 2;
  for (int c = 0; c < even; ++c) {
    window[c] = std::pow(std::sin(std::numbers::pi * (c + 0.5) / even), 2);
  }
  return window;
}

// Weighted signal of the even and the odd columns of the sensor.
struct ParitySums {
  std::array<double, 2> signal{};

  double Total() const { return signal[0] + signal[1]; }
  double Contrast() const { return Total() > 0 ? 2 * (signal[1] - signal[0]) / Total() : 0; }
};

// Column of a sample that represents the region's columns of one parity.
int SampleColumn(const ExpectedFrame& sample, int column) {
  return std::min(column, sample.mean_dn.columns_px - 1);
}

// Sum of the window over every second column of a segment, by the columns' parity in the region.
using SegmentWeights = std::array<double, 2>;

std::vector<SegmentWeights> WeightsOfSegments(const std::vector<double>& window, int segments,
                                              int power) {
  std::vector<SegmentWeights> weights(segments, SegmentWeights{});
  for (int segment = 0; segment < segments; ++segment) {
    const auto [first, last] = BlockColumns(static_cast<int>(window.size()), segments, segment);
    for (int c = first; c < last; ++c) weights[segment][c % 2] += std::pow(window[c], power);
  }
  return weights;
}

// Expectation of the compared pixels.
struct ExpectedParity {
  ParitySums sums;
  std::vector<ParitySums> of_segment;
  std::vector<double> of_row;  // weighted signal of every row of the block
};

ExpectedParity ExpectParity(const ExpectedSet& expected, const ParityBlock& block) {
  const int f = block.frames.front();
  const int segments = static_cast<int>(expected.strips.size());
  const std::vector<SegmentWeights> weights =
      WeightsOfSegments(ParityWindow(block.roi.columns_px), segments, 1);
  ExpectedParity parity;
  parity.of_segment.resize(segments);
  parity.of_row.assign(block.rows, 0);
  for (int segment = 0; segment < segments; ++segment) {
    const ExpectedFrame& sample = expected.strips[segment][f];
    for (int i = 0; i < block.rows; ++i) {
      const int row = block.first_row + i;
      for (int c = 0; c < 2; ++c) {
        if (!IsCompared(sample.frame.sensor, block.roi, row, c)) continue;
        const double signal =
            weights[segment][c] * (sample.MeanDn(row, SampleColumn(sample, c)) - block.dark_dn);
        parity.of_segment[segment].signal[ParityOf(block.roi, c)] += signal;
        parity.of_row[i] += signal;
      }
    }
    for (int p = 0; p < 2; ++p) parity.sums.signal[p] += parity.of_segment[segment].signal[p];
  }
  return parity;
}

// Largest contrast that a line of this course across the rows gives a Bayer sensor, over its place:
// twice its transform at 1/2 per row over that at 0. The transform is read at a lower frequency and
// falls like that of a normal distribution.
double SamplingAmplitude(const std::vector<double>& of_row) {
  std::complex<double> transform = 0;
  double sum = 0;
  for (size_t i = 0; i < of_row.size(); ++i) {
    sum += of_row[i];
    transform += std::polar(std::max(0.0, of_row[i]),
                            -2 * std::numbers::pi * kReadFrequency * static_cast<double>(i));
  }
  if (!(sum > 0)) return 0;
  return 2 * std::pow(std::min(1.0, std::abs(transform) / sum), std::pow(0.5 / kReadFrequency, 2));
}

// Variance by errors of the model of the image.
double ModelVariance(const ExpectedParity& parity, bool colour, size_t blocks) {
  double variance = static_cast<double>(blocks) * kCommonError * kCommonError;
  if (!colour || !(parity.sums.Total() > 0)) return variance;
  variance += std::pow(kSamplingError * SamplingAmplitude(parity.of_row), 2);
  const double mean = parity.sums.Contrast();
  for (const ParitySums& of_segment : parity.of_segment) {
    const double share = of_segment.Total() / parity.sums.Total();
    variance += share * std::pow(kSegmentError * (of_segment.Contrast() - mean), 2);
  }
  return variance;
}

// Second moments of the compared pixels of one row, averaged over the segments with the squared
// window as weight.
struct ParityRow {
  double level_dn = 0;   // standard deviation by speckle
  double noise_dn2 = 0;  // variance by noise and fixed pattern
  int column = 0;        // a compared column of the region
};

std::vector<ParityRow> RowsOf(const ExpectedSet& expected, const ParityBlock& block) {
  const int f = block.frames.front();
  const int segments = static_cast<int>(expected.strips.size());
  const std::vector<SegmentWeights> weights =
      WeightsOfSegments(ParityWindow(block.roi.columns_px), segments, 2);
  std::vector<ParityRow> rows(block.rows);
  for (int i = 0; i < block.rows; ++i) {
    const int row = block.first_row + i;
    double level = 0, noise = 0, sum = 0;
    for (int segment = 0; segment < segments; ++segment) {
      const ExpectedFrame& sample = expected.strips[segment][f];
      for (int c = 0; c < 2; ++c) {
        if (!IsCompared(sample.frame.sensor, block.roi, row, c)) continue;
        const int column = SampleColumn(sample, c);
        const double weight = weights[segment][c];
        rows[i].column = column;
        level += weight * sample.level_variance_dn2.At(row, column);
        noise += weight * (sample.noise_variance_dn2.At(row, column) +
                           block.sharing_pattern * sample.pattern_variance_dn2.At(row, column));
        sum += weight;
      }
    }
    if (!(sum > 0)) continue;
    rows[i].level_dn = std::sqrt(std::max(0.0, level / sum));
    rows[i].noise_dn2 = noise / sum;
  }
  return rows;
}

// Speckle of a row's pixels in alternating sums: for rows some distance apart
//   sum over d of (-1)^d r(distance, d) sum over c of w_c w_(c + d),
// r the correlation of two pixels. On a Bayer sensor the pairs of green pixels count.
class AlternatingSpeckle {
 public:
  AlternatingSpeckle(const std::vector<double>& window, int max_lag, bool colour)
      : products_(max_lag + 1, 0), colour_(colour) {
    for (int d = 0; d <= max_lag; ++d) {
      for (size_t c = 0; c + d < window.size(); ++c) products_[d] += window[c] * window[c + d];
    }
  }

  double Of(const SpecklePixelCovariance& speckle, int distance) const {
    const double one = speckle.At(0, 0);
    if (!(one > 0)) return 0;
    const int max_lag = static_cast<int>(products_.size()) - 1;
    double sum = 0;
    for (int d = -max_lag; d <= max_lag; ++d) {
      const bool odd = d % 2 != 0;
      if (colour_ && odd != (distance % 2 != 0)) continue;
      sum += (odd ? -1 : 1) * speckle.At(distance, d) / one * products_[std::abs(d)];
    }
    return colour_ ? sum / 2 : sum;
  }

 private:
  std::vector<double> products_;  // of the window with itself, by distance
  bool colour_;
};

// Variance of the alternating sum by speckle [DN^2].
double SpeckleOfAlternation(const ExpectedFrame& sample, const ParityBlock& block,
                            const std::vector<double>& window, const std::vector<ParityRow>& rows) {
  if (sample.speckle == nullptr) return 0;
  const int max_lag = sample.speckle->max_lag();
  const bool colour = sample.frame.sensor.colour_filter != ColourFilter::kMono;
  const AlternatingSpeckle alternating(window, max_lag, colour);
  // Indexed by row and distance; the covariance of two rows is the mean of what the speckle at each
  // gives.
  std::vector<std::vector<double>> sums;
  for (int i = 0; i < block.rows; ++i) {
    const SpecklePixelCovariance& speckle = sample.SpeckleAt(block.first_row + i, rows[i].column);
    sums.emplace_back();
    for (int distance = -max_lag; distance <= max_lag; ++distance) {
      sums.back().push_back(alternating.Of(speckle, distance));
    }
  }
  double variance = 0;
  for (int i = 0; i < block.rows; ++i) {
    variance += rows[i].level_dn * rows[i].level_dn * sums[i][max_lag];
    for (int j = i + 1; j < block.rows && j - i <= max_lag; ++j) {
      const double both = sums[i][max_lag + j - i] + sums[j][max_lag + i - j];
      variance += rows[i].level_dn * rows[j].level_dn * both;
    }
  }
  return std::max(0.0, variance);
}

// Variance of the alternating sum by noise, fixed patterns and offsets of rows and columns [DN^2].
double NoiseOfAlternation(const ExpectedFrame& sample, const ParityBlock& block,
                          const std::vector<double>& window, const std::vector<ParityRow>& rows) {
  double sum = 0, squares = 0;
  for (double weight : window) {
    sum += weight;
    squares += weight * weight;
  }
  // Fraction of a row's pixels that is compared.
  const bool colour = sample.frame.sensor.colour_filter != ColourFilter::kMono;
  const double fraction = colour ? 0.5 : 1;
  double variance = 0;
  for (const ParityRow& row : rows) variance += row.noise_dn2 * fraction * squares;
  // The offset of a row cancels in the row unless all of its compared pixels have one parity.
  const double in_row = colour ? sum * fraction : 0;
  variance += block.rows * std::pow(sample.row_scatter_dn * in_row, 2);
  // Offsets of columns are fixed for the sensor.
  variance += block.sharing_pattern * squares *
              std::pow(sample.column_scatter_dn * block.rows * fraction, 2);
  return variance;
}

// Mean signal of every row's compared pixels, and the fraction of them that is saturated.
struct RowSignals {
  std::vector<double> mean_dn, saturated;
};

template <typename PixelValues>
RowSignals SignalsOf(const FrameSetup& frame, int columns_px, const PixelValues& values_at) {
  RowSignals signals;
  const double dark_dn = DarkMeanDn(frame.sensor);
  const double top_dn = kSaturatedPixel * frame.sensor.largest_dn();
  for (int row = 0; row < frame.roi.rows_px; ++row) {
    double sum = 0, saturated = 0, count = 0;
    for (int c = 0; c < columns_px; ++c) {
      if (!IsCompared(frame.sensor, frame.roi, row, c)) continue;
      for (const double value : values_at(row, c)) {
        sum += value;
        saturated += value > top_dn ? 1 : 0;
        ++count;
      }
    }
    signals.mean_dn.push_back(count > 0 ? sum / count - dark_dn : 0);
    signals.saturated.push_back(count > 0 ? saturated / count : 0);
  }
  return signals;
}

// Signals of a recording, or of the expectation of one that is only planned.
RowSignals SignalsOf(const RecordedFrame& recorded) {
  const FrameSetup& frame = recorded.nominal;
  if (!recorded.raw_dn.empty()) {
    return SignalsOf(frame, frame.roi.columns_px, [&](int row, int c) {
      return std::array<double, 1>{static_cast<double>(recorded.raw_dn.At(row, c))};
    });
  }
  FrameSetup sample = frame;
  sample.roi = StripRegion(frame.roi, 1, 0, kJudgedColumns_px);
  const ExpectedFrame nominal = ExpectFrame(sample, {}, nullptr, nullptr, kJudgedLevels);
  return SignalsOf(frame, sample.roi.columns_px, [&](int row, int c) {
    std::vector<double> levels;
    for (const Image<float>& level : nominal.level_dn) levels.push_back(level.At(row, c));
    return levels;
  });
}

// First row and number of rows that hold the line and its flanks: the lit rows and as many on
// either side, so that the sums hardly depend on where the line is cut off. No rows: too dark, or
// saturated.
std::pair<int, int> RowsOfLine(const RecordedFrame& recorded) {
  const RowSignals signals = SignalsOf(recorded);
  const double least_dn = kLitRow * recorded.nominal.sensor.largest_dn();
  const int rows_px = recorded.nominal.roi.rows_px;
  int first = rows_px, last = 0;
  for (int row = 0; row < rows_px; ++row) {
    if (signals.mean_dn[row] < least_dn) continue;
    first = std::min(first, row);
    last = row + 1;
  }
  const int lit = last - first;
  if (lit < 1) return {0, 0};
  double saturated = 0;
  for (int row = first; row < last; ++row) saturated += signals.saturated[row] / lit;
  if (saturated > kMostSaturated) return {0, 0};
  // One row more where a single one is lit, so that both parities of green pixels are seen.
  const int room = std::max(1, lit);
  first = std::max(0, first - room);
  last = std::min(rows_px, last + room);
  return {first, last - first};
}

}  // namespace

ColumnParityStatistic::ColumnParityStatistic(const RecordedSet& set) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    const RegionOfInterest& roi = recorded.nominal.roi;
    if (recorded.plate_position_id < 0 || roi.columns_px < kLeastWindow_px) continue;
    const auto [first_row, rows] = RowsOfLine(recorded);
    if (rows < 2) continue;
    ParityBlock block;
    block.frames = {static_cast<int>(f)};
    block.roi = roi;
    block.first_row = first_row;
    block.rows = rows;
    block.dark_dn = DarkMeanDn(recorded.nominal.sensor);
    blocks_.push_back(std::move(block));
  }
  for (ParityBlock& block : blocks_) {
    const RecordedFrame& own = set.frames[block.frames.front()];
    block.sharing_speckle = block.sharing_pattern = 0;
    for (const ParityBlock& other : blocks_) {
      const RecordedFrame& frame = set.frames[other.frames.front()];
      block.sharing_speckle += SameSpeckle(own, frame) ? 1 : 0;
      block.sharing_pattern +=
          block.roi.column_px == other.roi.column_px && block.roi.row_px == other.roi.row_px ? 1
                                                                                             : 0;
    }
  }
}

Eigen::VectorXd ColumnParityStatistic::Observed(const RecordedSet& set, int index) const {
  const ParityBlock& block = blocks_[index];
  const RecordedFrame& recorded = set.frames[block.frames.front()];
  const std::vector<double> window = ParityWindow(block.roi.columns_px);
  ParitySums sums;
  if (recorded.raw_dn.empty()) return Eigen::VectorXd::Zero(1);
  for (int row = block.first_row; row < block.first_row + block.rows; ++row) {
    for (int c = 0; c < block.roi.columns_px; ++c) {
      if (!IsCompared(recorded.nominal.sensor, block.roi, row, c)) continue;
      sums.signal[ParityOf(block.roi, c)] +=
          window[c] * (recorded.raw_dn.At(row, c) - block.dark_dn);
    }
  }
  return Eigen::VectorXd::Constant(1, sums.Contrast());
}

Eigen::VectorXd ColumnParityStatistic::Expected(const ExpectedSet& expected, int index) const {
  return Eigen::VectorXd::Constant(1, ExpectParity(expected, blocks_[index]).sums.Contrast());
}

Eigen::MatrixXd ColumnParityStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const ParityBlock& block = blocks_[index];
  const ExpectedFrame& middle = expected.strips[expected.strips.size() / 2][block.frames.front()];
  const ExpectedParity parity = ExpectParity(expected, block);
  const double total = parity.sums.Total();
  // Without light the component is uninformative.
  if (!(total > 0)) return Eigen::MatrixXd::Ones(1, 1);
  const std::vector<double> window = ParityWindow(block.roi.columns_px);
  const std::vector<ParityRow> rows = RowsOf(expected, block);
  const double of_sum = block.sharing_speckle * SpeckleOfAlternation(middle, block, window, rows) +
                        NoiseOfAlternation(middle, block, window, rows);
  const bool colour = middle.frame.sensor.colour_filter != ColourFilter::kMono;
  return Eigen::MatrixXd::Constant(
      1, 1, 4 * of_sum / (total * total) + ModelVariance(parity, colour, blocks_.size()));
}

}  // namespace sightline
