// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/histogram_statistic.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "core/statistics/normal_distribution.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Lowest bits that are tested. Chosen: a stuck higher bit shows in every profile.
constexpr int kBits = 4;
constexpr int kLaserValues = kBits + 1;
// Pixels that may exceed the plateau. Chosen: more than the hot pixels of a usual region.
constexpr int kExceeding = 30;
// Fewer pixels make a bit uninformative. Chosen: the mean of as many is close to normal.
constexpr double kFewPixelsOfBit = 100;
// Relative error of the expected count of black pixels. Chosen: the tails of noise are not known
// better.
constexpr double kBlackError = 0.05;
// Side of the part of a dark frame in which effects are evaluated. Chosen: it contains enough
// pixels and rows to average fixed and random offsets.
constexpr int kPatch_px = 48;
// Variance of an uninformative component: of a bit, whose mean is within 1.
constexpr double kUninformativeBit = 100;
// Variance of the plateau [DN^2]. Chosen: rounding and the few pixels above.
constexpr double kPlateauVariance_dn2 = 2;
// Anscombe's constant.
constexpr double kThreeEighths = 0.375;

// The raw value that only a few pixels exceed.
double LargestValue(std::vector<uint16_t> raw) {
  if (raw.size() <= kExceeding) return 0;
  std::nth_element(raw.begin(), raw.begin() + kExceeding, raw.end(), std::greater<uint16_t>());
  return raw[kExceeding];
}

// Weights of the raw values: a squared sine between values well above dark noise and well below
// `top_dn`, where saturated pixels accumulate. The two are a whole number of periods of the highest
// bit apart.
std::vector<double> Window(const Sensor& sensor, double top_dn) {
  constexpr int kPeriod = 1 << kBits;
  const double noise_dn = sensor.gain_dn_per_electron * sensor.dark_noise_electrons;
  const double dark_dn = DarkMeanDn(sensor);
  const int numbers = static_cast<int>(sensor.largest_dn()) + 1;
  constexpr int kAboveNoise = 6;  // standard deviations
  const int first = kPeriod * (1 + static_cast<int>((dark_dn + kAboveNoise * noise_dn) / kPeriod));
  // Chosen: a narrower window is not smooth against the highest bit.
  constexpr int kNarrow = 16 * kPeriod;
  int last = static_cast<int>(top_dn) / kPeriod * kPeriod - kPeriod;
  if (last < first + kNarrow) last = numbers - kPeriod;
  std::vector<double> window(numbers, 0);
  for (int dn = first; dn < last; ++dn) {
    window[dn] = std::pow(std::sin(std::numbers::pi * (dn - first) / (last - first)), 2);
  }
  return window;
}

double Sign(uint32_t dn, int bit) { return (dn >> bit & 1) != 0 ? 1 : -1; }

// Effective number of pixels with these weights: (sum w)^2 / sum w^2.
double Counted(double sum, double square) { return square > 0 ? sum * sum / square : 0; }

// Raw value that the effects of the converter make of every raw value.
std::vector<uint16_t> Converted(const FrameSetup& frame, std::span<const ActiveEffect> effects) {
  Image<uint16_t> ramp(static_cast<int>(frame.sensor.largest_dn()) + 1, 1);
  for (int dn = 0; dn < ramp.columns_px; ++dn) ramp.values[dn] = static_cast<uint16_t>(dn);
  for (const ActiveEffect& active : effects) {
    active.effect->OnRaw(ramp, frame, active.parameters);
  }
  return ramp.values;
}

// Plateau of the levels of speckle: the largest level, if speckle that is one level weaker reaches
// it too in several rows; 0: none. `largest` becomes the largest level in any case.
double Plateau(const std::vector<std::vector<ExpectedFrame>>& strips, int f, double* largest) {
  constexpr double kFlat_dn = 0.5;
  *largest = 0;
  for (const std::vector<ExpectedFrame>& samples : strips) {
    const Image<float>& level = samples[f].level_dn.back();
    *largest =
        std::max<double>(*largest, *std::max_element(level.values.begin(), level.values.end()));
  }
  int rows = 0;
  for (const std::vector<ExpectedFrame>& samples : strips) {
    const std::vector<Image<float>>& levels = samples[f].level_dn;
    if (levels.size() < 2) return 0;
    const Image<float>& weaker = levels[levels.size() - 2];
    // Odd and even columns of a mono sensor may differ: the brighter ones have the plateau.
    const bool mono = samples[f].frame.sensor.colour_filter == ColourFilter::kMono;
    const int columns = mono ? std::min(2, weaker.columns_px) : 1;
    for (int row = 0; row < weaker.rows_px; ++row) {
      const float brighter = *std::max_element(weaker.Row(row), weaker.Row(row) + columns);
      rows += brighter > *largest - kFlat_dn ? 1 : 0;
    }
  }
  // Chosen: two rows of every segment on average.
  return rows >= 2 * static_cast<int>(strips.size()) ? *largest : 0;
}

double WeightOf(const std::vector<double>& window, size_t dn) {
  return dn < window.size() ? window[dn] : 0;
}

// Expected fraction of the pixels of a dark frame that read 0.
double BlackShare(const FrameSetup& frame, std::span<const ActiveEffect> effects) {
  const Sensor& sensor = frame.sensor;
  FrameSetup patch = frame;
  patch.roi.columns_px = patch.roi.rows_px = kPatch_px;
  const double current = DarkCurrentElectrons(frame);
  Image<double> electrons(kPatch_px, kPatch_px, sensor.dark_mean_electrons + current);
  for (const ActiveEffect& active : effects) {
    active.effect->OnElectrons(electrons, patch, active.parameters);
  }
  const double gain = sensor.gain_dn_per_electron;
  const double noise_dn = gain * std::sqrt(std::pow(sensor.dark_noise_electrons, 2) + current +
                                           std::pow(sensor.dsnu_electrons, 2));
  // Values up to half of one below the first that is not converted to 0 read 0.
  const std::vector<uint16_t> converted = Converted(frame, effects);
  const auto black =
      std::find_if(converted.begin(), converted.end(), [](uint16_t dn) { return dn != 0; });
  const double edge_dn = static_cast<double>(black - converted.begin()) - 0.5;
  double share = 0;
  for (double mean : electrons.values) {
    const double below = (edge_dn - gain * mean - sensor.black_level_dn) / noise_dn;
    share += NormalDistribution(below) / static_cast<double>(electrons.values.size());
  }
  return share;
}

// Sums of the window's weights over the levels of speckle of a recording.
struct WindowSums {
  double sum = 0, square = 0, pixels = 0;
};

WindowSums SumsOfLevels(const ExpectedSet& expected, int frame, const std::vector<double>& window) {
  WindowSums sums;
  for (const std::vector<ExpectedFrame>& samples : expected.strips) {
    for (const Image<float>& level : samples[frame].level_dn) {
      for (float dn : level.values) {
        const auto value = static_cast<size_t>(std::lround(std::max(0.0F, dn)));
        const double weight = WeightOf(window, value);
        sums.sum += weight;
        sums.square += weight * weight;
        ++sums.pixels;
      }
    }
  }
  return sums;
}

}  // namespace

HistogramStatistic::HistogramStatistic(const RecordedSet& set) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    Block block;
    block.frames = {static_cast<int>(f)};
    block.laser = recorded.plate_position_id >= 0;
    block.columns_px = recorded.nominal.roi.columns_px;
    block.rows_px = recorded.nominal.roi.rows_px;
    if (block.laser) {
      const Sensor& sensor = recorded.nominal.sensor;
      const bool seen = !recorded.raw_dn.empty();
      block.window =
          Window(sensor, seen ? LargestValue(recorded.raw_dn.values) : sensor.largest_dn() + 1);
      if (!recorded.raw_dn.empty()) {
        double sum = 0, square = 0;
        for (uint16_t dn : recorded.raw_dn.values) {
          const double weight = WeightOf(block.window, dn);
          sum += weight;
          square += weight * weight;
        }
        block.counted = Counted(sum, square);
      }
    }
    blocks_.push_back(std::move(block));
  }
}

Eigen::VectorXd HistogramStatistic::Observed(const RecordedSet& set, int index) const {
  const Block& block = blocks_[index];
  const std::vector<uint16_t>& raw = set.frames[block.frames.front()].raw_dn.values;
  if (!block.laser) {
    const double black = static_cast<double>(std::count(raw.begin(), raw.end(), 0));
    return Eigen::VectorXd::Constant(1, 2 * std::sqrt(black + kThreeEighths));
  }
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLaserValues);
  double weights = 0;
  for (uint16_t dn : raw) {
    const double weight = WeightOf(block.window, dn);
    if (weight == 0) continue;
    weights += weight;
    for (int bit = 0; bit < kBits; ++bit) values[bit] += weight * Sign(dn, bit);
  }
  if (weights > 0) values /= weights;
  values[kBits] = LargestValue(raw);
  return values;
}

Eigen::VectorXd HistogramStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const int f = block.frames.front();
  const FrameSetup& frame = expected.strips.front()[f].frame;
  if (!block.laser) {
    const double count = BlackShare(frame, expected.effects) * block.columns_px * block.rows_px;
    return Eigen::VectorXd::Constant(1, 2 * std::sqrt(count + kThreeEighths));
  }
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLaserValues);
  double weights = 0;
  for (uint16_t dn : Converted(frame, expected.effects)) {
    const double weight = WeightOf(block.window, dn);
    weights += weight;
    for (int bit = 0; bit < kBits; ++bit) values[bit] += weight * Sign(dn, bit);
  }
  if (weights > 0) values /= weights;
  double largest = 0;
  Plateau(expected.strips, f, &largest);
  values[kBits] = largest;
  return values;
}

Eigen::MatrixXd HistogramStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Block& block = blocks_[index];
  const int f = block.frames.front();
  if (!block.laser) {
    const double root = Expected(expected, index)[0];
    // The transformed count of few pixels is skewed.
    const double skewed = 4 / (1 + 0.25 * root * root);
    return Eigen::MatrixXd::Constant(1, 1, 1 + skewed + std::pow(0.5 * kBlackError * root, 2));
  }
  double counted = block.counted;
  if (counted < 0) {
    // A planned recording has the values of the levels of speckle.
    const WindowSums sums = SumsOfLevels(expected, f, block.window);
    counted = Counted(sums.sum, sums.square) * block.columns_px * block.rows_px / sums.pixels;
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kLaserValues, kLaserValues);
  for (int bit = 0; bit < kBits; ++bit) {
    covariance(bit, bit) = counted < kFewPixelsOfBit ? kUninformativeBit : 1 / counted;
  }
  double largest = 0;
  const double top = expected.strips.front()[f].frame.sensor.largest_dn();
  covariance(kBits, kBits) =
      Plateau(expected.strips, f, &largest) > 0 ? kPlateauVariance_dn2 : top * top;
  return covariance;
}

}  // namespace sightline
