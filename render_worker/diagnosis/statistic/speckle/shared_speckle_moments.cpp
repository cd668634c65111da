// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/speckle/shared_speckle_moments.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/statistics/normal_distribution.h"
#include "render_worker/diagnosis/statistic/speckle/speckle_decorrelation.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Levels of speckle are far apart where light is strong, so that single ones would show in the
// bins. There each level is divided into as many parts, interpolated linearly to its neighbours.
// Chosen: odd, so that the middle part is the level itself.
constexpr size_t kPartsOfLevel = 3;
// Level relative to the largest raw value up to which levels are interpolated. Chosen: saturation
// bends the response above.
constexpr double kStraight = 0.7;
// Standard deviations beyond which a normal distribution counts as zero. Chosen: 3e-7 lies beyond.
constexpr double kNegligibleTail = 5;
// Half a raw value: a pixel is full from this far below its saturation on [DN].
constexpr double kFullMargin_dn = 0.5;
// Least signal that a variance is divided by [DN].
constexpr double kLeastSignal_dn = 1e-9;

// Temporal noise variance at a level [DN^2]: dark noise and the shot noise of the signal above the
// dark mean; rounding only where the pixel is full.
double TemporalVariance(const ExpectedFrame& expected, double level_dn) {
  const Sensor& sensor = expected.frame.sensor;
  const double gain = sensor.gain_dn_per_electron;
  const double dark_dn = DarkMeanDn(sensor);
  const double full_dn = gain * sensor.saturation_capacity_electrons + sensor.black_level_dn;
  if (level_dn > full_dn - kFullMargin_dn) return expected.rounding_variance_dn2;
  return std::pow(gain * sensor.dark_noise_electrons, 2) + expected.rounding_variance_dn2 +
         gain * std::max(0.0, level_dn - dark_dn);
}

// Fractions of a normal distribution between consecutive edges.
void FractionsBetween(const std::vector<double>& edges, double mean, double deviation,
                      std::vector<double>& fractions) {
  const auto below = [&](double edge) {
    const double x = (edge - mean) / deviation;
    return x > kNegligibleTail ? 1.0 : x < -kNegligibleTail ? 0.0 : NormalDistribution(x);
  };
  double last = below(edges.front());
  for (size_t i = 0; i + 1 < edges.size(); ++i) {
    const double next = below(edges[i + 1]);
    fractions[i] = next - last;
    last = next;
  }
}

double LevelDn(const ExpectedFrame& frame, int row, int column, size_t level) {
  return frame.level_dn[level].At(row, column);
}

// 1 where noise is larger than the step to the next level in all of these recordings.
size_t PartsOfLevel(const std::vector<ExpectedFrame>& samples, const std::vector<int>& frames,
                    int row, int column, size_t level) {
  for (int f : frames) {
    const size_t levels = samples[f].level_dn.size();
    if (levels < 2) continue;
    const size_t below = std::min(level, levels - 2);
    const double here = LevelDn(samples[f], row, column, below);
    const double step = LevelDn(samples[f], row, column, below + 1) - here;
    if (step * step > TemporalVariance(samples[f], here)) return kPartsOfLevel;
  }
  return 1;
}

// Values of a pixel in two recordings at a part of a level [DN].
std::pair<double, double> LevelsAt(const ExpectedFrame& a, const ExpectedFrame& b, int row,
                                   int column, size_t level, size_t part, size_t parts) {
  std::pair values(LevelDn(a, row, column, level), LevelDn(b, row, column, level));
  const size_t last = a.level_dn.size() - 1;
  const double offset = (static_cast<double>(part) + 0.5) / static_cast<double>(parts) - 0.5;
  if (last == 0 || offset == 0) return values;
  const size_t below = offset < 0 && level > 0 ? level - 1 : std::min(level, last - 1);
  const double above_b = LevelDn(b, row, column, below + 1);
  if (above_b > kStraight * b.frame.sensor.largest_dn()) return values;
  values.first += offset * (LevelDn(a, row, column, below + 1) - LevelDn(a, row, column, below));
  values.second += offset * (above_b - LevelDn(b, row, column, below));
  return values;
}

// Sums the moments segment by segment, pixel by pixel, level by level, pair by pair.
class MomentSums {
 public:
  MomentSums(const ExpectedSet& expected, const SharedSpeckleBlock& block, bool with_common)
      : block_(block), with_common_(with_common) {
    const size_t pairs = block.pairs.size();
    const int bins = block.pairs.front().bins();
    moments_.count = moments_.sum = moments_.noise = Eigen::VectorXd::Zero(block.size);
    moments_.square = moments_.weight = Eigen::VectorXd::Zero(block.size);
    fractions_.resize(bins);
    fractions_before_.resize(bins);
    for (size_t i = 0; i < pairs; ++i) {
      moments_.decorrelation.push_back(
          SpeckleDecorrelation(expected.strips.front()[block.pairs[i].first],
                               expected.strips.front()[block.pairs[i].second], expected.effects));
      if (i > 0) moments_.common.emplace_back(Eigen::MatrixXd::Zero(bins, bins));
    }
    // The columns of one colour-filter cell represent all of their segment. Columns of a mono
    // sensor are equal unless an effect makes odd and even ones differ.
    const Sensor& sensor = expected.strips.front()[block.frames.front()].frame.sensor;
    const bool mono = sensor.colour_filter == ColourFilter::kMono;
    cell_columns_ = mono && !ColumnsAlternate(expected.effects) ? 1 : 2;
    segments_ = expected.strips.size();
  }

  void AddSegment(const std::vector<ExpectedFrame>& samples) {
    const ExpectedFrame& any = samples[block_.frames.front()];
    pixels_of_level_ = static_cast<double>(block_.columns_px) /
                       static_cast<double>(segments_ * cell_columns_ * any.level_dn.size());
    const int rows_px = any.noise_variance_dn2.rows_px;
    row_offsets_ = any.row_scatter_dn > 0;
    if (row_offsets_ && moments_.of_rows.size() == 0) {
      moments_.of_rows = Eigen::MatrixXd::Zero(block_.size, rows_px);
    }
    for (int row = 0; row < rows_px; ++row) {
      for (int column = 0; column < cell_columns_; ++column) AddPixel(samples, row, column);
    }
  }

  SharedSpeckleMoments Finish() {
    // The variance ratio compares squared differences about the mean of each bin. Where the line
    // has moved or light has spread, the expectations of a bin's pixels differ too.
    int at = 0;
    for (const ExposurePair& pair : block_.pairs) {
      const int ratio = at + pair.variance_ratio();
      for (int bin = at; bin < at + pair.bins(); ++bin) {
        if (moments_.count[bin] <= 0) continue;
        const double mean = moments_.sum[bin] / moments_.count[bin];
        moments_.count[ratio] += moments_.count[bin];
        moments_.sum[ratio] += moments_.square[bin] - mean * mean * moments_.weight[bin];
      }
      at += pair.size();
    }
    return std::move(moments_);
  }

 private:
  // Values of one part of a level in the two recordings of a pair, and their noise variances.
  struct PairLevels {
    double a = 0, b = 0;
    double noise_a = 0, noise_b = 0;
  };

  void AddPixel(const std::vector<ExpectedFrame>& samples, int row, int column) {
    SetSpeckleSpread(samples, row, column);
    const size_t levels = samples[block_.frames.front()].level_dn.size();
    for (size_t level = 0; level < levels; ++level) {
      const size_t parts = PartsOfLevel(samples, block_.frames, row, column, level);
      for (size_t part = 0; part < parts; ++part) {
        AddPart(samples, row, column, level, part, parts);
      }
    }
  }

  // Variance of a pixel's levels over their mean above dark, of every pair's second recording whose
  // speckle has moved.
  void SetSpeckleSpread(const std::vector<ExpectedFrame>& samples, int row, int column) {
    const size_t pairs = block_.pairs.size();
    spread_.assign(pairs, 0);
    dark_dn_.assign(pairs, 0);
    for (size_t i = 0; i < pairs; ++i) {
      if (moments_.decorrelation[i] == 0) continue;
      // The first recording of the next pair is the second one of this pair.
      const ExpectedFrame& sample = samples[block_.pairs[i].second];
      spread_[i] = sample.level_variance_dn2.At(row, column);
      dark_dn_[i] = DarkMeanDn(sample.frame.sensor);
      spread_[i] /= std::max(kLeastSignal_dn, sample.MeanDn(row, column) - dark_dn_[i]);
    }
  }

  void AddPart(const std::vector<ExpectedFrame>& samples, int row, int column, size_t level,
               size_t part, size_t parts) {
    const double pixels = pixels_of_level_ / static_cast<double>(parts);
    int at = 0;
    bool used_before = false;
    for (size_t i = 0; i < block_.pairs.size(); ++i) {
      const ExposurePair& pair = block_.pairs[i];
      const ExpectedFrame& a = samples[pair.first];
      const ExpectedFrame& b = samples[pair.second];
      const auto [level_a, level_b] = LevelsAt(a, b, row, column, level, part, parts);
      const PairLevels levels = {level_a, level_b, TemporalVariance(a, level_a),
                                 TemporalVariance(b, level_b)};
      // Linear interpolation is wrong where saturation begins: whole levels count there.
      if (part == parts / 2) AddSaturated(pair, at, levels);
      const double sum_dn = levels.a + levels.b;
      const double deviation =
          std::sqrt(levels.noise_a + levels.noise_b + RowOffsetVariance(a, b, 1));
      const bool used = sum_dn + kNegligibleTail * deviation > pair.edges_dn.front() &&
                        sum_dn - kNegligibleTail * deviation < pair.edges_dn.back();
      if (used) {
        FractionsBetween(pair.edges_dn, sum_dn, deviation, fractions_);
        AddBins(i, at, row, pixels, a, b, levels, used_before && with_common_);
      }
      used_before = used;
      fractions_before_.swap(fractions_);
      at += pair.size();
    }
  }

  void AddSaturated(const ExposurePair& pair, int at, const PairLevels& levels) {
    const double deviation = std::sqrt(levels.noise_a);
    if (levels.a + kNegligibleTail * deviation <= pair.saturated_dn) return;
    const double fraction = 1 - NormalDistribution((pair.saturated_dn - levels.a) / deviation);
    moments_.count[at + pair.saturated()] += pixels_of_level_ * fraction;
    moments_.sum[at + pair.saturated()] += pixels_of_level_ * fraction * levels.b;
  }

  // Adds `pixels` pixels of pair i, distributed over the bins by fractions_.
  void AddBins(size_t i, int at, int row, double pixels, const ExpectedFrame& a,
               const ExpectedFrame& b, const PairLevels& levels, bool with_common) {
    const ExposurePair& pair = block_.pairs[i];
    const Sensor& sensor = b.frame.sensor;
    const double difference = levels.b - pair.ratio * levels.a;
    // The fixed offsets of the pixels do not scale with the exposure.
    const double dsnu = sensor.dsnu_electrons * sensor.gain_dn_per_electron * (1 - pair.ratio);
    // Moving speckle changes in proportion to the root of the irradiance: the derivatives of a
    // circular Gaussian field are independent of the field (Goodman, Speckle Phenomena in Optics,
    // on the derivatives of speckle intensity).
    const double noise =
        levels.noise_b + pair.ratio * pair.ratio * levels.noise_a + dsnu * dsnu +
        2 * moments_.decorrelation[i] * spread_[i] * std::max(0.0, levels.b - dark_dn_[i]);
    const double nominal = pair.NominalVariance(levels.a + levels.b);
    const double of_row = RowOffsetVariance(a, b, pair.ratio);
    for (int bin = 0; bin < pair.bins(); ++bin) {
      if (fractions_[bin] == 0) continue;
      const double weight = pixels * fractions_[bin];
      moments_.count[at + bin] += weight;
      moments_.sum[at + bin] += weight * difference;
      moments_.noise[at + bin] += weight * noise;
      moments_.square[at + bin] += weight * (noise + of_row + difference * difference) / nominal;
      if (row_offsets_) {
        moments_.of_rows(at + bin, row) += weight;
        moments_.of_rows(at + pair.variance_ratio(), row) += weight * of_row / nominal;
      }
      moments_.weight[at + bin] += weight / nominal;
      if (!with_common) continue;
      for (int other = 0; other < pair.bins(); ++other) {
        moments_.common[i - 1](other, bin) -=
            fractions_before_[other] * weight * pair.ratio * levels.noise_a;
      }
    }
  }

  const SharedSpeckleBlock& block_;
  bool with_common_;
  int cell_columns_ = 1;
  size_t segments_ = 0;
  SharedSpeckleMoments moments_;
  // Values of the present segment.
  double pixels_of_level_ = 0;
  bool row_offsets_ = false;
  // Values of the present pixel, by pair.
  std::vector<double> spread_, dark_dn_;
  // Fractions of the present part of a level: of its pair and of the pair before.
  std::vector<double> fractions_, fractions_before_;
};

}  // namespace

SharedSpeckleMoments ExpectSharedSpeckle(const ExpectedSet& expected,
                                         const SharedSpeckleBlock& block, bool with_common) {
  MomentSums sums(expected, block, with_common);
  for (const std::vector<ExpectedFrame>& samples : expected.strips) sums.AddSegment(samples);
  return sums.Finish();
}

double RowOffsetVariance(const ExpectedFrame& a, const ExpectedFrame& b, double ratio) {
  return std::pow(b.row_scatter_dn, 2) + std::pow(ratio * a.row_scatter_dn, 2);
}

}  // namespace sightline
