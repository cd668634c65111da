// SPDX-License-Identifier: Apache-2.0
#include "core/recordings/linearity.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace sightline {
namespace {

// Nothing but exposure time and noise differs.
bool SameScene(const RecordedImage& a, const RecordedImage& b) {
  return a.kind == RecordingKind::kLaser && b.kind == RecordingKind::kLaser &&
         a.plate_position_id && b.plate_position_id &&
         *a.plate_position_id == *b.plate_position_id && a.f_number == b.f_number &&
         a.camera_distance_m == b.camera_distance_m && a.focus_distance_m == b.focus_distance_m &&
         a.laser_distance_m == b.laser_distance_m && a.line_offset_m == b.line_offset_m &&
         a.roi_column_px == b.roi_column_px && a.roi_row_px == b.roi_row_px;
}

// Straight line through points with weights.
struct Slope {
  double weight = 0, x = 0, y = 0, xx = 0, xy = 0;

  void Add(double px, double py, double w) {
    weight += w;
    x += w * px;
    y += w * py;
    xx += w * px * px;
    xy += w * px * py;
  }
  double Spread() const { return xx - x * x / weight; }
  double Value() const { return (xy - x * y / weight) / Spread(); }
};

}  // namespace

Linearity MeasureLinearity(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn,
                           double dark_level_dn, double full_dn) {
  Linearity result;
  const double gain = set.camera.gain_dn_per_electron;
  const double dark_noise_dn =
      std::hypot(gain * set.camera.dark_noise_electrons, std::sqrt(1 / 12.0));
  // From here on photon noise is most of the noise, if the numbers are raw.
  const double least_signal_dn = 3 * dark_noise_dn * dark_noise_dn / gain;
  // Two bins an octave of the signal above the dark level.
  constexpr int kBins = 2 * 16;
  struct Bin {
    double count = 0, signal = 0, variance = 0;
  };
  std::array<Bin, kBins> bins{};
  const int count = static_cast<int>(set.recordings.size());
  std::vector<double> exposure, signal;
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) {
      if (raw_dn[i].empty() || raw_dn[j].empty()) continue;
      if (!SameScene(set.recordings[i], set.recordings[j])) continue;
      if (raw_dn[i].values.size() != raw_dn[j].values.size()) continue;
      const std::vector<uint16_t>& a = raw_dn[i].values;
      const std::vector<uint16_t>& b = raw_dn[j].values;
      const double t_a = set.recordings[i].exposure_time_s;
      const double t_b = set.recordings[j].exposure_time_s;
      if (t_a != t_b) {
        // Pixels that are lit in both and clipped in neither; chosen by the sum, so that noise
        // favours neither.
        double sum_a = 0, sum_b = 0, pixels = 0;
        for (size_t p = 0; p < a.size(); ++p) {
          const double lit = a[p] + b[p] - 2 * dark_level_dn;
          if (std::max(a[p], b[p]) >= 0.9 * full_dn || lit < 0.1 * full_dn) continue;
          sum_a += a[p] - dark_level_dn;
          sum_b += b[p] - dark_level_dn;
          ++pixels;
        }
        const double longer = std::max(t_a, t_b) / std::min(t_a, t_b);
        if (pixels >= 100 && sum_a > 0 && sum_b > 0 && longer >= 3) {
          exposure.push_back(std::log(t_b / t_a));
          signal.push_back(std::log(sum_b / sum_a));
        }
        continue;
      }
      // Per bin the variance about the mean difference: light that changed between the two as a
      // whole is no noise.
      struct Sums {
        double count = 0, signal = 0, difference = 0, squares = 0;
      };
      std::array<Sums, kBins> sums{};
      for (size_t p = 0; p < a.size(); ++p) {
        const double mean = 0.5 * (a[p] + b[p]);
        const double lit = mean - dark_level_dn;
        if (lit < least_signal_dn || mean > 0.85 * full_dn) continue;
        Sums& s = sums[std::clamp(static_cast<int>(2 * std::log2(lit)), 0, kBins - 1)];
        const double difference = static_cast<double>(a[p]) - b[p];
        s.count += 1;
        s.signal += lit;
        s.difference += difference;
        s.squares += difference * difference;
      }
      for (int bin = 0; bin < kBins; ++bin) {
        const Sums& s = sums[bin];
        if (s.count < 30) continue;
        bins[bin].count += s.count;
        bins[bin].signal += s.signal;
        bins[bin].variance +=
            (s.squares - s.difference * s.difference / s.count) / 2 * s.count / (s.count - 1);
      }
    }
  }
  if (!exposure.empty()) {
    Slope slope;
    double largest = 0;
    for (size_t i = 0; i < exposure.size(); ++i) {
      // Through the origin: both signs of every pair.
      slope.Add(exposure[i], signal[i], 1);
      slope.Add(-exposure[i], -signal[i], 1);
      largest = std::max(largest, std::abs(exposure[i]));
    }
    if (largest >= std::log(3.0)) result.exposure_exponent = slope.Value();
  }
  Slope slope;
  double least = 1e300, most = 0;
  int used = 0;
  for (const Bin& bin : bins) {
    if (bin.count < 50 || !(bin.variance > 0)) continue;
    const double mean = bin.signal / bin.count;
    // Standard error of the log of a variance: sqrt(2 / n).
    slope.Add(std::log(mean), std::log(bin.variance / bin.count), bin.count / 2);
    least = std::min(least, mean);
    most = std::max(most, mean);
    ++used;
  }
  if (used >= 3 && most >= 3 * least) {
    result.noise_exponent = slope.Value();
    result.noise_exponent_error = 1 / std::sqrt(slope.Spread());
  }
  return result;
}

namespace {

constexpr int kGroups = 10;
constexpr int kLevelBins = 2 * 16;  // two an octave
constexpr double kFewPixels = 200;
// Variances below this are rounding and little else [DN^2].
constexpr double kLeastVariance_dn2 = 0.05;

struct LevelSums {
  double count = 0, level = 0, variance = 0;

  void Add(const LevelSums& other) {
    count += other.count;
    level += other.level;
    variance += other.variance;
  }
};
using LevelNoise = std::array<LevelSums, kLevelBins>;

void AddImage(const Image<uint16_t>& image, double full_dn, LevelNoise* noise) {
  // A second difference of independent values of variance v has the variance 6 v.
  constexpr double kSecondDifference = 6;
  for (int row = 0; row < image.rows_px; ++row) {
    const uint16_t* values = image.Row(row);
    for (int c = 1; c + 1 < image.columns_px; c += 3) {
      const double level = (values[c - 1] + values[c] + values[c + 1]) / 3.0;
      const double second = values[c - 1] - 2.0 * values[c] + values[c + 1];
      if (level < 1 || std::max({values[c - 1], values[c], values[c + 1]}) > 0.85 * full_dn) {
        continue;
      }
      LevelSums& bin = (*noise)[static_cast<size_t>(
          std::min(static_cast<int>(2 * std::log2(level)), kLevelBins - 1))];
      bin.count += 1;
      bin.level += level;
      bin.variance += second * second / kSecondDifference;
    }
  }
}

std::optional<double> ExponentOf(const LevelNoise& noise) {
  Slope slope;
  double least = 1e300, most = 0;
  int used = 0;
  for (const LevelSums& bin : noise) {
    if (bin.count < kFewPixels) continue;
    const double variance = bin.variance / bin.count - 1 / 12.0;
    if (variance < kLeastVariance_dn2) continue;
    const double level = bin.level / bin.count;
    slope.Add(std::log(level), std::log(variance), 1);
    least = std::min(least, level);
    most = std::max(most, level);
    ++used;
  }
  if (used < 3 || most < 3 * least) return std::nullopt;
  return slope.Value();
}

}  // namespace

std::optional<SingleImageNoise> MeasureSingleImageNoise(const RecordingSet& set,
                                                        const std::vector<Image<uint16_t>>& raw_dn,
                                                        double full_dn) {
  std::vector<LevelNoise> groups(kGroups);
  int used = 0;
  for (size_t i = 0; i < raw_dn.size(); ++i) {
    if (set.recordings[i].kind != RecordingKind::kLaser || raw_dn[i].empty()) continue;
    AddImage(raw_dn[i], full_dn, &groups[static_cast<size_t>(used++ % kGroups)]);
  }
  const int group_count = std::min(used, kGroups);
  if (group_count < 4) return std::nullopt;
  const auto exponent_without = [&](int left_out) {
    LevelNoise sum{};
    for (int g = 0; g < group_count; ++g) {
      if (g == left_out) continue;
      for (size_t bin = 0; bin < sum.size(); ++bin)
        sum[bin].Add(groups[static_cast<size_t>(g)][bin]);
    }
    return ExponentOf(sum);
  };
  const std::optional<double> exponent = exponent_without(-1);
  if (!exponent) return std::nullopt;
  double square = 0;
  for (int g = 0; g < group_count; ++g) {
    const double off = exponent_without(g).value_or(*exponent) - *exponent;
    square += off * off;
  }
  const double n = group_count;
  return SingleImageNoise{*exponent, std::sqrt(square * (n - 1) / n)};
}

}  // namespace sightline
