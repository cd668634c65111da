// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/burst_statistic.h"

#include <algorithm>
#include <utility>

#include "render_worker/sensor/expose.h"
#include "render_worker/speckle/speckle_statistics.h"

namespace sightline {

namespace {

// Standard deviation of the expectation. Chosen: the model takes Gaussian for Poisson noise, and
// speckle does not cancel exactly where it saturates.
constexpr double kBurstModelError = 2e-4;
// A preceding exposure must be longer than that of the compared frame by this factor. Chosen:
// similar frames leave a similar lag, which cancels in the difference.
constexpr double kBrighter = 1.5;

std::vector<double> RowMeans(const Image<uint16_t>& raw) {
  std::vector<double> means(raw.rows_px, 0);
  for (int row = 0; row < raw.rows_px; ++row) {
    for (int c = 0; c < raw.columns_px; ++c) means[row] += raw.At(row, c);
    means[row] /= std::max(1, raw.columns_px);
  }
  return means;
}

// Expected row means: of both columns of a Bayer cell and all segments along the line.
std::vector<double> RowMeans(const ExpectedSet& expected, int f) {
  std::vector<double> means(expected.strips.front()[f].noise_variance_dn2.rows_px, 0);
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    for (size_t row = 0; row < means.size(); ++row) {
      for (int c = 0; c < 2; ++c) {
        means[row] += samples[f].MeanDn(static_cast<int>(row), c) /
                      static_cast<double>(2 * expected.strips.size());
      }
    }
  }
  return means;
}

// Weights of the rows whose contrast is the least-squares slope against `cause`. Their sum is 0.
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

void Subtract(const std::vector<double>& rows, std::vector<double>& from) {
  for (size_t row = 0; row < from.size(); ++row) from[row] -= rows[row];
}

// Weighted sum of the rows.
double Contrast(const std::vector<double>& weights, const std::vector<double>& rows) {
  double sum = 0;
  for (size_t row = 0; row < std::min(weights.size(), rows.size()); ++row) {
    sum += weights[row] * rows[row];
  }
  return sum;
}

// Adds the variance of the contrast by the noise of one sample. `pixels`: columns of the frame
// times the two columns of a Bayer cell times the segments along the line, over which noise
// averages out.
void AddNoise(const ExpectedFrame& sample, const std::vector<double>& weights, bool with_pattern,
              double pixels, double& variance) {
  for (size_t row = 0; row < weights.size(); ++row) {
    for (int c = 0; c < 2; ++c) {
      const int r = static_cast<int>(row);
      const double noise = sample.noise_variance_dn2.At(r, c) +
                           (with_pattern ? sample.pattern_variance_dn2.At(r, c) : 0.0F);
      variance += weights[row] * weights[row] * noise / pixels;
    }
  }
}

}  // namespace

BurstStatistic::BurstStatistic(const RecordedSet& set) {
  for (int f = 1; f < static_cast<int>(set.frames.size()); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    Block block;
    block.seen = f;
    block.preceding = PrecedingFrame(set, f);
    block.columns_px = recorded.nominal.roi.columns_px;
    if (block.preceding < 0) continue;
    if (recorded.plate_position_id < 0) {
      if (set.frames[block.preceding].plate_position_id < 0) continue;
      block.frames = {block.preceding, f};
    } else if (!FindComparison(set, block)) {
      continue;
    }
    if (!recorded.raw_dn.empty()) {
      std::vector<double> cause = RowMeans(set.frames[block.preceding].raw_dn);
      if (block.preceding_compared >= 0) {
        Subtract(RowMeans(set.frames[block.preceding_compared].raw_dn), cause);
      }
      block.weights = SlopeWeights(std::move(cause));
    }
    blocks_.push_back(std::move(block));
  }
}

// Finds the earlier recording that a lit frame is compared with: the first one of the same scene
// and settings. False: there is none, or both follow frames of similar brightness.
bool BurstStatistic::FindComparison(const RecordedSet& set, Block& block) {
  const RecordedFrame& recorded = set.frames[block.seen];
  for (int other = 0; other < block.seen && block.compared < 0; ++other) {
    const RecordedFrame& earlier = set.frames[other];
    if (earlier.plate_position_id == recorded.plate_position_id &&
        earlier.repeat_group == recorded.repeat_group) {
      block.compared = other;
    }
  }
  if (block.compared < 0) return false;
  block.preceding_compared = PrecedingFrame(set, block.compared);
  const auto exposure = [&](int frame) {
    return frame < 0 ? 0 : set.frames[frame].nominal.exposure_time_s;
  };
  if (exposure(block.preceding) < kBrighter * exposure(block.preceding_compared)) return false;
  block.frames = {block.compared, block.preceding, block.seen};
  if (block.preceding_compared >= 0) block.frames.push_back(block.preceding_compared);
  std::sort(block.frames.begin(), block.frames.end());
  block.frames.erase(std::unique(block.frames.begin(), block.frames.end()), block.frames.end());
  return true;
}

// Weights of the rows: from the recordings, or from the expectation for a planned set.
std::vector<double> BurstStatistic::Weights(const ExpectedSet& expected, const Block& block) {
  if (!block.weights.empty()) return block.weights;
  std::vector<double> cause = RowMeans(expected, block.preceding);
  if (block.preceding_compared >= 0) {
    Subtract(RowMeans(expected, block.preceding_compared), cause);
  }
  return SlopeWeights(std::move(cause));
}

Eigen::VectorXd BurstStatistic::Observed(const RecordedSet& set, int index) const {
  const Block& block = blocks_[index];
  double value = Contrast(block.weights, RowMeans(set.frames[block.seen].raw_dn));
  if (block.compared >= 0) {
    value -= Contrast(block.weights, RowMeans(set.frames[block.compared].raw_dn));
  }
  return Eigen::VectorXd::Constant(1, value);
}

Eigen::VectorXd BurstStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const std::vector<double> weights = Weights(expected, block);
  double value = Contrast(weights, RowMeans(expected, block.seen));
  if (block.compared >= 0) value -= Contrast(weights, RowMeans(expected, block.compared));
  return Eigen::VectorXd::Constant(1, value);
}

Eigen::MatrixXd BurstStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const std::vector<double> weights = Weights(expected, block);
  double variance = kBurstModelError * kBurstModelError;
  // The lag has the speckle of the preceding frame.
  const ExpectedFrame& lit = expected.strips.front()[block.preceding];
  if (lit.speckle != nullptr) {
    std::vector<double> lag = RowMeans(expected, block.seen);
    std::vector<double> without(lag.size(), DarkMeanDn(lit.frame.sensor));
    if (block.compared >= 0) without = RowMeans(expected, block.compared);
    for (size_t row = 0; row < lag.size(); ++row) {
      lag[row] = row < weights.size() ? weights[row] * (lag[row] - without[row]) : 0;
    }
    variance += VarianceOfRows(*lit.speckle, lag, static_cast<int>(block.columns_px), 1,
                               lit.frame.roi.row_px, lit.frame.sensor.pixel_pitch_m);
  }
  for (int f : {block.seen, block.compared}) {
    if (f < 0) continue;
    // Fixed patterns cancel between repeats.
    const bool with_pattern = block.compared < 0;
    for (const std::vector<ExpectedFrame>& samples : expected.strips) {
      AddNoise(samples[f], weights, with_pattern,
               block.columns_px * 2 * static_cast<double>(expected.strips.size()), variance);
    }
  }
  return Eigen::MatrixXd::Constant(1, 1, variance);
}

}  // namespace sightline
