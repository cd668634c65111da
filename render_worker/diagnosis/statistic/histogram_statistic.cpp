// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/histogram_statistic.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

constexpr int kBits = 4;
constexpr int kExceeding = 30;           // pixels above the plateau's number
constexpr double kFewPixelsOfBit = 100;  // a bit's mean is not near normal below
constexpr double kBlackError = 0.05;     // of the expected count: tails of the noise
constexpr int kPatch_px = 48;            // of a dark frame, with its fixed and jumping offsets
constexpr int kLaserValues = kBits + 1;

// The number that only a few pixels exceed.
double LargestNumber(std::vector<uint16_t> raw) {
  if (raw.size() <= kExceeding) return 0;
  std::nth_element(raw.begin(), raw.begin() + kExceeding, raw.end(), std::greater<uint16_t>());
  return raw[kExceeding];
}

// Squared sine between numbers well above dark noise and well below `top_dn` (where pixels may be
// full and pile up), a whole number of periods of the highest bit apart.
std::vector<double> Window(const Sensor& sensor, double top_dn) {
  constexpr int kPeriod = 1 << kBits;
  const double noise_dn = sensor.gain_dn_per_electron * sensor.dark_noise_electrons;
  const double dark_dn = DarkMeanDn(sensor);
  const int numbers = static_cast<int>(sensor.largest_dn()) + 1;
  const int first = kPeriod * (1 + static_cast<int>((dark_dn + 6 * noise_dn) / kPeriod));
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

// Independent pixels that weigh as much as these.
double Counted(double sum, double square) { return square > 0 ? sum * sum / square : 0; }

// Number that the converter's effects make of every number.
std::vector<uint16_t> Converted(const FrameSetup& frame, std::span<const ActiveEffect> effects) {
  Image<uint16_t> ramp(static_cast<int>(frame.sensor.largest_dn()) + 1, 1);
  for (int dn = 0; dn < ramp.columns_px; ++dn) ramp.values[dn] = static_cast<uint16_t>(dn);
  for (const ActiveEffect& active : effects) {
    active.effect->OnRaw(ramp, frame, active.parameters);
  }
  return ramp.values;
}

// Plateau of the levels of speckle: the largest level, if speckle that is one step weaker reaches
// it as well in several rows; 0: none.
double Plateau(const std::vector<std::vector<ExpectedFrame>>& strips, int f, double* largest) {
  constexpr double kFlat_dn = 0.5;
  *largest = 0;
  for (const std::vector<ExpectedFrame>& strip : strips) {
    const Image<float>& level = strip[f].level_dn.back();
    *largest =
        std::max<double>(*largest, *std::max_element(level.values.begin(), level.values.end()));
  }
  int rows = 0;
  for (const std::vector<ExpectedFrame>& strip : strips) {
    const std::vector<Image<float>>& levels = strip[f].level_dn;
    if (levels.size() < 2) return 0;
    const Image<float>& weaker = levels[levels.size() - 2];
    for (int row = 0; row < weaker.rows_px; ++row) {
      rows += weaker.At(row, 0) > *largest - kFlat_dn ? 1 : 0;
    }
  }
  // A row in each strip.
  return rows >= 2 * static_cast<int>(strips.size()) ? *largest : 0;
}

}  // namespace

HistogramStatistic::HistogramStatistic(const RecordedSet& set) {
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    Entry entry;
    entry.frames = {static_cast<int>(f)};
    entry.laser = recorded.plate_position_id >= 0;
    entry.columns_px = recorded.nominal.roi.columns_px;
    entry.rows_px = recorded.nominal.roi.rows_px;
    if (entry.laser) {
      const Sensor& sensor = recorded.nominal.sensor;
      const bool seen = !recorded.raw_dn.empty();
      entry.window =
          Window(sensor, seen ? LargestNumber(recorded.raw_dn.values) : sensor.largest_dn() + 1);
      if (!recorded.raw_dn.empty()) {
        double sum = 0, square = 0;
        for (uint16_t dn : recorded.raw_dn.values) {
          const double weight = dn < entry.window.size() ? entry.window[dn] : 0;
          sum += weight;
          square += weight * weight;
        }
        entry.counted = Counted(sum, square);
      }
    }
    entries_.push_back(std::move(entry));
  }
}

Eigen::VectorXd HistogramStatistic::Observed(const RecordedSet& set, int index) const {
  const Entry& entry = entries_[index];
  const std::vector<uint16_t>& raw = set.frames[entry.frames.front()].raw_dn.values;
  if (!entry.laser) {
    const double black = static_cast<double>(std::count(raw.begin(), raw.end(), 0));
    return Eigen::VectorXd::Constant(1, 2 * std::sqrt(black + 0.375));
  }
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLaserValues);
  double weights = 0;
  for (uint16_t dn : raw) {
    const double weight = dn < entry.window.size() ? entry.window[dn] : 0;
    if (weight == 0) continue;
    weights += weight;
    for (int bit = 0; bit < kBits; ++bit) values[bit] += weight * Sign(dn, bit);
  }
  if (weights > 0) values /= weights;
  values[kBits] = LargestNumber(raw);
  return values;
}

Eigen::VectorXd HistogramStatistic::Expected(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  const int f = entry.frames.front();
  const FrameSetup& frame = expected.strips.front()[f].frame;
  if (!entry.laser) {
    // A patch, with what effects do to the charge.
    const Sensor& sensor = frame.sensor;
    FrameSetup patch = frame;
    patch.roi.columns_px = patch.roi.rows_px = kPatch_px;
    const double current = DarkCurrentElectrons(frame);
    Image<double> electrons(kPatch_px, kPatch_px, sensor.dark_mean_electrons + current);
    for (const ActiveEffect& active : expected.effects) {
      active.effect->OnElectrons(electrons, patch, active.parameters);
    }
    const double gain = sensor.gain_dn_per_electron;
    const double noise_dn = gain * std::sqrt(std::pow(sensor.dark_noise_electrons, 2) + current +
                                             std::pow(sensor.dsnu_electrons, 2));
    // Every number up to this one is read as 0.
    const std::vector<uint16_t> converted = Converted(frame, expected.effects);
    const auto black =
        std::find_if(converted.begin(), converted.end(), [](uint16_t dn) { return dn != 0; });
    const double edge_dn = static_cast<double>(black - converted.begin()) - 0.5;
    double share = 0;
    for (double mean : electrons.values) {
      const double below = (edge_dn - gain * mean - sensor.black_level_dn) / noise_dn;
      share += 0.5 * std::erfc(-below / std::numbers::sqrt2) /
               static_cast<double>(electrons.values.size());
    }
    const double count = share * entry.columns_px * entry.rows_px;
    return Eigen::VectorXd::Constant(1, 2 * std::sqrt(count + 0.375));
  }
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLaserValues);
  double weights = 0;
  for (uint16_t dn : Converted(frame, expected.effects)) {
    const double weight = dn < entry.window.size() ? entry.window[dn] : 0;
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
  const Entry& entry = entries_[index];
  const int f = entry.frames.front();
  if (!entry.laser) {
    const double root = Expected(expected, index)[0];
    // Few pixels: the root is skewed still.
    const double skewed = 4 / (1 + 0.25 * root * root);
    return Eigen::MatrixXd::Constant(1, 1, 1 + skewed + std::pow(0.5 * kBlackError * root, 2));
  }
  double counted = entry.counted;
  if (counted < 0) {
    // What the levels of speckle would fill.
    double sum = 0, square = 0, pixels = 0;
    for (const std::vector<ExpectedFrame>& strips : expected.strips) {
      for (const Image<float>& level : strips[f].level_dn) {
        for (float dn : level.values) {
          const auto number = static_cast<size_t>(std::lround(std::max(0.0F, dn)));
          const double weight = number < entry.window.size() ? entry.window[number] : 0;
          sum += weight;
          square += weight * weight;
          ++pixels;
        }
      }
    }
    counted = Counted(sum, square) * entry.columns_px * entry.rows_px / pixels;
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kLaserValues, kLaserValues);
  for (int bit = 0; bit < kBits; ++bit) {
    covariance(bit, bit) = counted < kFewPixelsOfBit ? 100 : 1 / counted;
  }
  double largest = 0;
  const double top = expected.strips.front()[f].frame.sensor.largest_dn();
  covariance(kBits, kBits) = Plateau(expected.strips, f, &largest) > 0 ? 2 : top * top;
  return covariance;
}

}  // namespace sightline
