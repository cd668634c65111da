// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/noise/repeat_statistic.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/statistic/noise/bin_moments.h"
#include "render_worker/diagnosis/statistic/speckle/speckle_decorrelation.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Level relative to the largest raw value up to which pixels are far from saturation. Chosen: the
// noise of a pixel at four fifths does not reach the largest value.
constexpr double kLinear = 0.8;
// Largest relative correction of the variance for a recorded mean that differs from the expected
// one. Chosen: where the means differ by more, the model is far off.
constexpr double kMostChange = 0.5;
// Relative error of what moved speckle adds to the variance between repeats. Chosen: its
// decorrelation is modelled by a Gaussian correlation of constant contrast.
constexpr double kMovedSpeckleError = 0.2;

// A common factor between two recordings (of their amount of light), by least squares over the
// pixels that are not near saturation. It is removed, so that it does not count as noise.
class CommonFactor {
 public:
  CommonFactor(double black_dn, double top_dn) : black_dn_(black_dn), top_dn_(top_dn) {}
  void Add(double a, double b) {
    if (a > top_dn_ || b > top_dn_) return;
    const double signal = 0.5 * (a + b) - black_dn_;
    product_ += (a - b) * signal;
    square_ += signal * signal;
  }
  double Difference(double a, double b) const {
    const double factor = square_ > 0 ? product_ / square_ : 0;
    return a - b - factor * (0.5 * (a + b) - black_dn_);
  }

 private:
  double black_dn_, top_dn_;
  double product_ = 0, square_ = 0;
};

struct BinSums {
  double mean_dn = 0, variance_dn2 = 0;
};

// Adds the expected mean and temporal variance of a pixel that represents its segment. `moved`:
// decorrelation of the speckle between the two recordings.
void AddExpectedPixel(const ExpectedFrame& first, const ExpectedFrame& second, int row,
                      const PixelPlane& plane, const CommonFactor& factor, double moved,
                      BinSums& sums) {
  const int column = plane.first_column;
  sums.mean_dn +=
      (MeanOfColumns(first.mean_dn, row, plane) + MeanOfColumns(second.mean_dn, row, plane)) / 2;
  sums.variance_dn2 +=
      (first.noise_variance_dn2.At(row, column) + second.noise_variance_dn2.At(row, column) +
       std::pow(first.row_scatter_dn, 2) + std::pow(second.row_scatter_dn, 2)) /
      2;
  const size_t levels = first.level_dn.size();
  for (size_t q = 0; q < levels; ++q) {
    const double difference =
        factor.Difference(first.level_dn[q].At(row, column), second.level_dn[q].At(row, column));
    sums.variance_dn2 += difference * difference / (2 * static_cast<double>(levels));
  }
  if (moved > 0) sums.variance_dn2 += moved * MeanOfColumns(first.level_variance_dn2, row, plane);
}

// Mean speckle variance of a bin [DN^2].
double MeanLevelVariance(const ExpectedSet& expected, int frame, const PixelPlane& plane,
                         const ProfileBin& bin) {
  double level = 0;
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    for (int row : bin.rows) {
      level += samples[frame].level_variance_dn2.At(row, plane.first_column);
    }
  }
  level /= static_cast<double>(bin.rows.size() * expected.strips.size());
  return level;
}

// Level of the brightest speckle in a bin [DN].
double BrightestLevel(const ExpectedSet& expected, int frame, const PixelPlane& plane,
                      const ProfileBin& bin) {
  double highest = 0;
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    for (int row : bin.rows) {
      highest =
          std::max<double>(highest, samples[frame].level_dn.back().At(row, plane.first_column));
    }
  }
  return highest;
}

}  // namespace

RepeatStatistic::RepeatStatistic(const RecordedSet& set)
    : planes_(PixelPlanes(set.frames.front().nominal.sensor)) {
  for (size_t a = 0; a < set.frames.size(); ++a) {
    const RecordedFrame& first = set.frames[a];
    // Only the next repeat is paired, so that pairs share few recordings.
    size_t b = a + 1;
    while (b < set.frames.size() && (first.plate_position_id < 0 ||
                                     first.plate_position_id != set.frames[b].plate_position_id ||
                                     first.repeat_group != set.frames[b].repeat_group)) {
      ++b;
    }
    if (b == set.frames.size()) continue;
    const RecordedFrame& second = set.frames[b];
    Block block;
    block.frames = {static_cast<int>(a), static_cast<int>(b)};
    block.bins = MakeProfileBins(first, planes_);
    block.columns_px = first.nominal.roi.columns_px;
    if (!first.raw_dn.values.empty()) {
      for (const ProfileBin& bin : block.bins) {
        const PixelPlane& plane = planes_[bin.plane];
        block.recorded_mean_dn.push_back(
            0.5 * (MeanOfBin(first.raw_dn, plane, bin) + MeanOfBin(second.raw_dn, plane, bin)));
      }
    }
    blocks_.push_back(std::move(block));
  }
}

Eigen::VectorXd RepeatStatistic::Observed(const RecordedSet& set, int index) const {
  const Block& block = blocks_[index];
  const Image<uint16_t>& a = set.frames[block.frames[0]].raw_dn;
  const Image<uint16_t>& b = set.frames[block.frames[1]].raw_dn;
  const Sensor& sensor = set.frames[block.frames[0]].nominal.sensor;
  CommonFactor factor(DarkMeanDn(sensor), kLinear * sensor.largest_dn());
  for (size_t p = 0; p < a.values.size(); ++p) factor.Add(a.values[p], b.values[p]);
  Eigen::VectorXd values(block.bins.size());
  for (size_t i = 0; i < block.bins.size(); ++i) {
    const PixelPlane& plane = planes_[block.bins[i].plane];
    double sum = 0;
    int count = 0;
    for (int row : block.bins[i].rows) {
      for (int c = plane.first_column; c < a.columns_px; c += plane.step) {
        const double difference = factor.Difference(a.At(row, c), b.At(row, c));
        sum += difference * difference / 2;
        ++count;
      }
    }
    values[i] = sum / count;
  }
  return values;
}

Eigen::VectorXd RepeatStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const auto [first, second] = std::pair(block.frames[0], block.frames[1]);
  const Sensor& sensor = expected.strips.front()[first].frame.sensor;
  CommonFactor factor(DarkMeanDn(sensor), kLinear * sensor.largest_dn());
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    for (size_t q = 0; q < samples[first].level_dn.size(); ++q) {
      const std::vector<float>& a = samples[first].level_dn[q].values;
      const std::vector<float>& b = samples[second].level_dn[q].values;
      for (size_t p = 0; p < a.size(); ++p) factor.Add(a[p], b[p]);
    }
  }
  const double moved = SpeckleDecorrelation(expected.strips.front()[first],
                                            expected.strips.front()[second], expected.effects);
  Eigen::VectorXd values(block.bins.size());
  for (size_t i = 0; i < block.bins.size(); ++i) {
    const ProfileBin& bin = block.bins[i];
    BinSums sums;
    for (int row : bin.rows) {
      for (const std::vector<ExpectedFrame>& samples : expected.strips) {
        AddExpectedPixel(samples[first], samples[second], row, planes_[bin.plane], factor, moved,
                         sums);
      }
    }
    const auto count = static_cast<double>(bin.rows.size() * expected.strips.size());
    values[i] = sums.variance_dn2 / count;
    if (block.recorded_mean_dn.empty()) continue;
    // Shot noise is proportional to the mean. The recorded mean differs from the expected one by
    // its speckle on the line, and far from it by what is unknown about the lens.
    const double change =
        sensor.gain_dn_per_electron * (block.recorded_mean_dn[i] - sums.mean_dn / count);
    values[i] += std::clamp(change, -kMostChange * values[i], kMostChange * values[i]);
  }
  return values;
}

Eigen::MatrixXd RepeatStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const Eigen::VectorXd values = Expected(expected, index);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(values.size(), values.size());
  const int first = block.frames[0];
  const ExpectedFrame& front = expected.strips.front()[first];
  const double moved =
      SpeckleDecorrelation(front, expected.strips.front()[block.frames[1]], expected.effects);
  for (size_t i = 0; i < block.bins.size(); ++i) {
    const ProfileBin& bin = block.bins[i];
    const PixelPlane& plane = planes_[bin.plane];
    const double count = static_cast<double>(bin.rows.size()) * block.columns_px / plane.step;
    // Shot noise follows the speckle, so its variance differs between pixels; that adds to the 2 of
    // a normal distribution. Half the squared difference of two values has half of their excess
    // kurtosis. Random row offsets are as many as rows.
    const double kurtosis = MeanExcessKurtosis(expected, first, plane, bin);
    covariance(i, i) = values[i] * values[i] * (4 + kurtosis / 2) / count +
                       2 * std::pow(front.row_scatter_dn, 4) / static_cast<double>(bin.rows.size());
    if (moved > 0) {
      const double level = MeanLevelVariance(expected, first, plane, bin);
      covariance(i, i) += std::pow(kMovedSpeckleError * moved * level, 2);
    }
    // Saturated speckle has its noise cut off: the component is made uninformative.
    const double top = expected.strips.back()[first].frame.sensor.largest_dn();
    if (BrightestLevel(expected, first, plane, bin) > kLinear * top) covariance(i, i) = top * top;
  }
  return covariance;
}

}  // namespace sightline
