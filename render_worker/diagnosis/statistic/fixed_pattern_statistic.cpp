// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/fixed_pattern_statistic.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "render_worker/diagnosis/statistic/relative_residuals.h"
#include "render_worker/recordings/strips.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

struct Lag {
  int rows, columns;
};
constexpr Lag kLags[] = {{0, 0}, {0, 3}, {3, 0}, {0, 8}, {0, 16}, {0, 32}};
constexpr int kLagCount = static_cast<int>(std::size(kLags));
// Relative signal that blocks and their strips leave, squared.
constexpr double kPatternError = 1e-5;
constexpr double kAlongError = 0.1;  // of the product of the light along the line
constexpr double kLimit = 4;         // of dark residuals
constexpr double kDarkOutlier = 5;
constexpr int kDarkValues = 2;
constexpr int kDraws = 16;  // of what effects draw at random once a set

// Weight of a pixel's row with that of the pixel a lag away, summed over pairs of frames.
double PairWeight(const std::vector<double>& sum, const std::vector<std::vector<double>>& each,
                  int row, int parity, const Lag& lag) {
  const size_t here = 2 * row + parity;
  const size_t there = 2 * (row + lag.rows) + (parity + lag.columns) % 2;
  double value = sum[here] * sum[there];
  for (const std::vector<double>& weights : each) value -= weights[here] * weights[there];
  return 0.5 * value;
}

std::vector<double> Sum(const std::vector<std::vector<double>>& each) {
  std::vector<double> sum(each.front().size(), 0);
  for (const std::vector<double>& values : each) {
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += values[i];
  }
  return sum;
}

// Mean of rows' products at every lag, weighted with the pairs' weights.
std::array<double, kLagCount> Autocovariance(const Image<double>& pattern, int first_row,
                                             const std::vector<double>& sum,
                                             const std::vector<std::vector<double>>& each) {
  std::array<double, kLagCount> values{};
  for (int l = 0; l < kLagCount; ++l) {
    double weights = 0;
    for (int row = 0; row + kLags[l].rows < pattern.rows_px; ++row) {
      for (int parity = 0; parity < 2; ++parity) {
        const double weight = PairWeight(sum, each, first_row + row, parity, kLags[l]);
        if (weight == 0) continue;
        for (int c = parity; c + kLags[l].columns < pattern.columns_px; c += 2) {
          values[l] +=
              weight * pattern.At(row, c) * pattern.At(row + kLags[l].rows, c + kLags[l].columns);
          weights += weight;
        }
      }
    }
    if (weights > 0) values[l] /= weights;
  }
  return values;
}

double Limited(double x) { return std::clamp(x, -kLimit, kLimit); }

// Mean product over pairs of frames of the pixels, and of the columns' means without the part of
// the pixels themselves.
std::array<double, kDarkValues> DarkProducts(const std::vector<Image<double>>& frames) {
  const int columns = frames.front().columns_px, rows = frames.front().rows_px;
  double pixels = 0, column_means = 0;
  std::vector<double> total(frames.size());
  for (int c = 0; c < columns; ++c) {
    std::fill(total.begin(), total.end(), 0);
    for (int row = 0; row < rows; ++row) {
      double sum = 0, squares = 0;
      for (size_t f = 0; f < frames.size(); ++f) {
        const double value = frames[f].At(row, c);
        sum += value;
        squares += value * value;
        total[f] += value;
      }
      pixels += 0.5 * (sum * sum - squares);
    }
    double sum = 0, squares = 0;
    for (double value : total) {
      sum += value;
      squares += value * value;
    }
    column_means += 0.5 * (sum * sum - squares);
  }
  const double pairs = 0.5 * static_cast<double>(frames.size() * (frames.size() - 1));
  const double area = static_cast<double>(columns) * rows;
  // Products of different rows of a column only.
  return {pixels / (pairs * area),
          rows > 1 ? (column_means - pixels) / (pairs * area * (rows - 1)) : 0};
}

// Mean products, over pairs of frames, of the light along the line about its blocks' means: it
// stays on the sensor as far as it looks alike in all of them.
Eigen::VectorXd ProductsAlongLine(const ExpectedSet& expected, const std::vector<int>& frames,
                                  int columns_px) {
  Eigen::VectorXd products = Eigen::VectorXd::Zero(kLagCount);
  std::vector<std::vector<double>> deviations;  // of every frame, all along the line
  for (int f : frames) {
    std::vector<double> along;
    for (const std::vector<ExpectedFrame>& strips : expected.strips) {
      for (double level : strips[f].level_along_line) along.push_back(level - 1);
    }
    // A strip without light has none.
    if (along.empty() || (!deviations.empty() && along.size() != deviations.front().size())) {
      return products;
    }
    deviations.push_back(std::move(along));
  }
  const size_t places = deviations.front().size();
  for (int l = 0; l < kLagCount; ++l) {
    const double shift = kLags[l].columns * static_cast<double>(places) / columns_px;
    const auto below = static_cast<size_t>(shift);
    const double part = shift - static_cast<double>(below);
    double count = 0;
    for (size_t i = 0; i + below + 1 < places; ++i) {
      double here = 0, there = 0, squares = 0;
      for (const std::vector<double>& along : deviations) {
        const double shifted = (1 - part) * along[i + below] + part * along[i + below + 1];
        here += along[i];
        there += shifted;
        squares += along[i] * shifted;
      }
      products[l] += 0.5 * (here * there - squares);
      ++count;
    }
    const auto n = static_cast<double>(frames.size());
    products[l] /= std::max(1.0, count) * 0.5 * n * (n - 1);
  }
  return products;
}

// Correlation of the residuals of a frame: speckle's share of the scatter on the line, with
// speckle's own correlation.
struct ResidualCorrelation {
  double share = 0;
  const SpecklePixelCovariance* speckle = nullptr;

  double At(int rows, int columns) const {
    if (rows == 0 && columns == 0) return 1;
    return share * speckle->At(rows, columns) / speckle->At(0, 0);
  }
};

// Of every frame, on its row of most weight.
std::vector<ResidualCorrelation> SpeckleOfResiduals(
    const ExpectedSet& expected, const std::vector<int>& frames,
    const std::vector<std::vector<double>>& weights) {
  std::vector<ResidualCorrelation> correlations;
  for (size_t i = 0; i < frames.size(); ++i) {
    const ExpectedFrame& strip = expected.strips[expected.strips.size() / 2][frames[i]];
    const auto best = std::max_element(weights[i].begin(), weights[i].end()) - weights[i].begin();
    const int row = static_cast<int>(best / 2), parity = static_cast<int>(best % 2);
    const double mean = strip.MeanDn(row, parity);
    double levels = 0;
    for (const Image<float>& level : strip.level_dn) {
      levels +=
          std::pow(level.At(row, parity) - mean, 2) / static_cast<double>(strip.level_dn.size());
    }
    correlations.push_back(
        {levels / (levels + strip.noise_variance_dn2.At(row, parity)), &strip.SpeckleAt(row)});
  }
  return correlations;
}

// Sum of the pairs' weights over all pixels of a region, at every lag.
std::array<double, kLagCount> TotalWeights(const std::vector<double>& sum,
                                           const std::vector<std::vector<double>>& each,
                                           const RegionOfInterest& roi) {
  std::array<double, kLagCount> total{};
  for (int l = 0; l < kLagCount; ++l) {
    for (int row = 0; row + kLags[l].rows < roi.rows_px; ++row) {
      for (int parity = 0; parity < 2; ++parity) {
        total[l] +=
            PairWeight(sum, each, row, parity, kLags[l]) * (roi.columns_px - kLags[l].columns) / 2;
      }
    }
  }
  return total;
}

// Covariance of the mean products at two lags: for every pair of frames the sum over l of
// R_a(l) R_b(l + d) for all differences and sums d of the lags. 0 where there is no weight.
Eigen::MatrixXd OfSpeckleAndNoise(const std::vector<ResidualCorrelation>& correlations,
                                  const std::vector<std::vector<double>>& weights,
                                  const std::array<double, kLagCount>& total, int columns_px) {
  constexpr double kNegligible = 0.01;
  struct Correlated {
    int rows, columns;
    double value;
  };
  std::vector<std::vector<Correlated>> near(correlations.size());
  for (size_t i = 0; i < correlations.size(); ++i) {
    const int lag = correlations[i].speckle->max_lag();
    for (int r = -lag; r <= lag; ++r) {
      for (int c = -lag; c <= lag; ++c) {
        const double value = correlations[i].At(r, c);
        if (value > kNegligible) near[i].push_back({r, c, value});
      }
    }
  }
  const auto overlap = [&](size_t a, size_t b, int rows, int columns) {
    double sum = 0;
    for (const Correlated& l : near[a]) {
      sum += l.value * correlations[b].At(l.rows + rows, l.columns + columns);
    }
    return sum;
  };
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(kLagCount, kLagCount);
  for (size_t a = 0; a < correlations.size(); ++a) {
    for (size_t b = a + 1; b < correlations.size(); ++b) {
      double product = 0;
      for (size_t i = 0; i < weights[a].size(); ++i) product += weights[a][i] * weights[b][i];
      product *= columns_px / 2.0;
      if (product == 0) continue;
      for (int l = 0; l < kLagCount; ++l) {
        for (int m = l; m < kLagCount; ++m) {
          const double value =
              0.5 * product *
              (overlap(a, b, kLags[m].rows - kLags[l].rows, kLags[m].columns - kLags[l].columns) +
               overlap(a, b, kLags[m].rows + kLags[l].rows, kLags[m].columns + kLags[l].columns));
          covariance(l, m) += value;
        }
      }
    }
  }
  for (int l = 0; l < kLagCount; ++l) {
    for (int m = l; m < kLagCount; ++m) {
      const double totals = total[l] * total[m];
      covariance(l, m) = totals > 0 ? covariance(l, m) / totals : 0;
      covariance(m, l) = covariance(l, m);
    }
  }
  return covariance;
}

// Variance that a pattern of the pixels' sensitivity, of this variance, times all else gives the
// products at lag `l`, and its own scatter: per column, not yet over the weights.
double ScatterOfSensitivity(double prnu_squared, int l, const std::vector<double>& sum,
                            const std::vector<std::vector<double>>& weights) {
  double scatter = 0;
  for (size_t i = 0; i < sum.size(); ++i) {
    double squares = 0, mixed = 0;
    for (const std::vector<double>& each : weights) {
      squares += each[i] * each[i];
      mixed += each[i] * std::pow(sum[i] - each[i], 2);
    }
    const double pairs = 0.5 * (sum[i] * sum[i] - squares);
    scatter +=
        prnu_squared * mixed + (l == 0 ? 2 : 1) * prnu_squared * prnu_squared * pairs * pairs;
  }
  return scatter;
}

template <typename Value>
double Median(std::vector<Value> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Probability that noise of unit variance takes a pixel beyond what counts as an outlier.
double OutlierProbability(double residual) {
  return 0.5 * std::erfc((kDarkOutlier - residual) / std::sqrt(2.0));
}

// Of the pixels that may be outliers of the longest exposure: their places, and the probabilities
// to be one there and in every frame; for the longest exposure itself 0.
struct Outlier {
  size_t pixel;
  double in_longest;
  Eigen::VectorXd in_both;
};

std::vector<Outlier> PossibleOutliers(const std::vector<Image<double>>& frames, size_t longest) {
  constexpr double kImpossible = 0.5;
  std::vector<Outlier> outliers;
  for (size_t i = 0; i < frames[longest].values.size(); ++i) {
    if (frames[longest].values[i] < kImpossible) continue;
    Outlier outlier = {i, OutlierProbability(frames[longest].values[i]), {}};
    outlier.in_both = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(frames.size()));
    for (size_t f = 0; f < frames.size(); ++f) {
      if (f == longest) continue;
      outlier.in_both[static_cast<Eigen::Index>(f)] =
          outlier.in_longest * OutlierProbability(frames[f].values[i]);
    }
    outliers.push_back(std::move(outlier));
  }
  return outliers;
}

// Pixels that are outliers both in a frame and in the longest exposure, expected in every frame.
Eigen::VectorXd OutlierCounts(const std::vector<Image<double>>& frames, size_t longest) {
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(frames.size()));
  for (const Outlier& outlier : PossibleOutliers(frames, longest)) counts += outlier.in_both;
  return counts;
}

// Covariance between draws of a pattern whose pixels are independent, of the mean product of its
// pixels and of every frame's 2 sqrt(count + 3/8) of outliers: the same pixels stand out in all.
Eigen::MatrixXd ScatterOfDraws(const std::vector<Image<double>>& frames, size_t longest) {
  const auto count = static_cast<Eigen::Index>(frames.size());
  const auto area = static_cast<double>(frames.front().values.size());
  std::vector<double> products(frames.front().values.size());
  double sum = 0, squares = 0;
  for (size_t i = 0; i < products.size(); ++i) {
    double values = 0, own = 0;
    for (const Image<double>& frame : frames) {
      const double value = Limited(frame.values[i]);
      values += value;
      own += value * value;
    }
    products[i] =
        (values * values - own) / static_cast<double>(frames.size() * (frames.size() - 1));
    sum += products[i];
    squares += products[i] * products[i];
  }
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(1 + count, 1 + count);
  covariance(0, 0) = (squares - sum * sum / area) / (area * area);
  Eigen::VectorXd counts = Eigen::VectorXd::Zero(count);
  for (const Outlier& outlier : PossibleOutliers(frames, longest)) {
    counts += outlier.in_both;
    if (outlier.in_longest < 1e-12) continue;
    covariance.block(1, 0, count, 1) += outlier.in_both * (products[outlier.pixel] / area);
    covariance.bottomRightCorner(count, count) +=
        outlier.in_both * outlier.in_both.transpose() / outlier.in_longest;
    covariance.diagonal().tail(count) +=
        outlier.in_both - outlier.in_both.cwiseAbs2() / outlier.in_longest;
  }
  covariance.block(1, 0, count, 1) -= counts * (sum / (area * area));
  const Eigen::VectorXd slopes = (counts.array() + 0.375).rsqrt();
  covariance.bottomRightCorner(count, count) =
      slopes.asDiagonal() * covariance.bottomRightCorner(count, count) * slopes.asDiagonal();
  covariance.block(1, 0, count, 1) = slopes.asDiagonal() * covariance.block(1, 0, count, 1);
  covariance.block(0, 1, 1, count) = covariance.block(1, 0, count, 1).transpose();
  return covariance;
}

// Rows may jump from frame to frame: no fixed pattern.
void SubtractRowMeans(Image<double>& image) {
  for (int row = 0; row < image.rows_px; ++row) {
    double sum = 0;
    for (int c = 0; c < image.columns_px; ++c) sum += image.At(row, c);
    for (int c = 0; c < image.columns_px; ++c) image.At(row, c) -= sum / image.columns_px;
  }
}

}  // namespace

FixedPatternStatistic::FixedPatternStatistic(const RecordedSet& set) {
  // Groups of the same region; of a plate position the recording with the middle exposure.
  using Key = std::tuple<bool, int, int, int, int>;
  std::map<Key, std::map<int, std::vector<int>>> groups;
  for (int f = 0; f < static_cast<int>(set.frames.size()); ++f) {
    const RecordedFrame& recorded = set.frames[f];
    const RegionOfInterest& roi = recorded.nominal.roi;
    const bool laser = recorded.plate_position_id >= 0;
    groups[{laser, roi.column_px, roi.row_px, roi.columns_px, roi.rows_px}]
          [laser ? recorded.plate_position_id : f]
              .push_back(f);
  }
  for (const auto& [key, positions] : groups) {
    if (positions.size() < 2) continue;
    Entry entry;
    entry.laser = std::get<0>(key);
    for (const auto& [position, frames] : positions) {
      std::vector<int> order = frames;
      std::stable_sort(order.begin(), order.end(), [&](int a, int b) {
        return set.frames[a].nominal.exposure_time_s < set.frames[b].nominal.exposure_time_s;
      });
      entry.frames.push_back(order[order.size() / 2]);
    }
    std::sort(entry.frames.begin(), entry.frames.end());
    const FrameSetup& front = set.frames[entry.frames.front()].nominal;
    const Sensor& sensor = front.sensor;
    entry.roi = front.roi;
    entry.offset_dn = DarkMeanDn(sensor);
    entry.noise_dn = std::sqrt(
        std::pow(sensor.gain_dn_per_electron * sensor.dark_noise_electrons, 2) + 1.0 / 12);
    for (size_t i = 0; i < entry.frames.size(); ++i) {
      const RecordedFrame& recorded = set.frames[entry.frames[i]];
      if (recorded.nominal.exposure_time_s >
          set.frames[entry.frames[entry.longest]].nominal.exposure_time_s) {
        entry.longest = i;
      }
      if (entry.laser && !recorded.raw_dn.empty()) {
        entry.weights.push_back(
            MakeRelativeResiduals(recorded.raw_dn, entry.offset_dn, sensor.largest_dn(), blocks_)
                .weights);
      }
    }
    entries_.push_back(std::move(entry));
  }
}

int FixedPatternStatistic::FrameOfRow(int entry, int row) const {
  const Entry& group = entries_[entry];
  // Counts of outliers are of one recording each; the rest is of all.
  return group.laser || row < kDarkValues ? group.frames.back() : group.frames[row - kDarkValues];
}

Eigen::VectorXd FixedPatternStatistic::Observed(const RecordedSet& set, int entry) const {
  return entries_[entry].laser ? ObservedPattern(set, entries_[entry])
                               : ObservedDark(set, entries_[entry]);
}

Eigen::VectorXd FixedPatternStatistic::Expected(const ExpectedSet& expected, int entry) const {
  return entries_[entry].laser ? ExpectedPattern(expected, entries_[entry])
                               : ExpectedDark(expected, entries_[entry]);
}

Eigen::VectorXd FixedPatternStatistic::ObservedPattern(const RecordedSet& set,
                                                       const Entry& entry) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLagCount);
  if (entry.weights.empty()) return values;
  Image<double> sum(entry.roi.columns_px, entry.roi.rows_px, 0.0);
  const auto products = [](const Image<double>& image, const Lag& lag) {
    double total = 0;
    for (int row = 0; row + lag.rows < image.rows_px; ++row) {
      const double* here = image.Row(row);
      const double* there = image.Row(row + lag.rows) + lag.columns;
      for (int c = 0; c + lag.columns < image.columns_px; ++c) total += here[c] * there[c];
    }
    return total;
  };
  for (int f : entry.frames) {
    const Image<uint16_t>& raw = set.frames[f].raw_dn;
    const RelativeResiduals residuals = MakeRelativeResiduals(
        raw, entry.offset_dn, set.frames[f].nominal.sensor.largest_dn(), blocks_);
    for (size_t i = 0; i < sum.values.size(); ++i) sum.values[i] += residuals.value.values[i];
    for (int l = 0; l < kLagCount; ++l) values[l] -= 0.5 * products(residuals.value, kLags[l]);
  }
  const std::vector<double> weights = Sum(entry.weights);
  for (int l = 0; l < kLagCount; ++l) {
    values[l] += 0.5 * products(sum, kLags[l]);
    double total = 0;
    for (int row = 0; row + kLags[l].rows < entry.roi.rows_px; ++row) {
      for (int parity = 0; parity < 2; ++parity) {
        total += PairWeight(weights, entry.weights, row, parity, kLags[l]) *
                 (entry.roi.columns_px - kLags[l].columns) / 2;
      }
    }
    values[l] = total > 0 ? values[l] / total : 0;
  }
  return values;
}

std::vector<FixedPatternStatistic::RowWeights> FixedPatternStatistic::Weights(
    const ExpectedSet& expected, const Entry& entry) const {
  if (!entry.weights.empty()) return entry.weights;
  std::vector<RowWeights> all;
  for (int f : entry.frames) {
    const ExpectedFrame& strip = expected.strips[expected.strips.size() / 2][f];
    RowWeights weights(2 * static_cast<size_t>(entry.roi.rows_px), 0);
    for (int row = 0; row < entry.roi.rows_px; ++row) {
      for (int parity = 0; parity < 2; ++parity) {
        const double mean = strip.MeanDn(row, parity), signal = mean - entry.offset_dn;
        if (signal < kLeastSignal_relative * strip.frame.sensor.largest_dn()) continue;
        double variance = strip.noise_variance_dn2.At(row, parity);
        for (const Image<float>& level : strip.level_dn) {
          variance += std::pow(level.At(row, parity) - mean, 2) /
                      static_cast<double>(strip.level_dn.size());
        }
        weights[2 * row + parity] = signal * signal / variance;
      }
    }
    all.push_back(std::move(weights));
  }
  return all;
}

std::vector<Eigen::VectorXd> FixedPatternStatistic::DrawnPatterns(const ExpectedSet& expected,
                                                                  const Entry& entry) const {
  std::vector<Eigen::VectorXd> drawn;
  if (expected.effects.empty()) return drawn;
  // The rows that count.
  const std::vector<RowWeights> weights = Weights(expected, entry);
  const std::vector<double> sum = Sum(weights);
  int first = entry.roi.rows_px, last = 0;
  for (int row = 0; row < entry.roi.rows_px; ++row) {
    const size_t even = 2 * static_cast<size_t>(row);
    if (sum[even] + sum[even + 1] == 0) continue;
    first = std::min(first, row);
    last = row + 1;
  }
  if (first >= last) return drawn;
  const FrameSetup& frame = expected.strips.front()[entry.frames.front()].frame;
  bool any = false;
  for (int draw = 0; draw < kDraws; ++draw) {
    FrameSetup patch = frame;
    patch.roi = {entry.roi.column_px, entry.roi.row_px + first, entry.roi.columns_px, last - first};
    patch.seeds.camera += draw;
    patch.seeds.rig += draw;
    PixelIrradiance light;
    light.roi = patch.roi;
    light.laser_irradiance_w_m2 = Image<float>(patch.roi.columns_px, patch.roi.rows_px, 1.0F);
    for (const ActiveEffect& active : expected.effects) {
      active.effect->OnPixelIrradiance(light, patch, active.parameters);
    }
    const std::vector<float>& factors = light.laser_irradiance_w_m2.values;
    drawn.push_back(Eigen::VectorXd::Zero(kLagCount));
    if (std::all_of(factors.begin(), factors.end(), [](float x) { return x == 1.0F; })) continue;
    any = true;
    Image<double> pattern(patch.roi.columns_px, patch.roi.rows_px);
    for (int row = 0; row < pattern.rows_px; ++row) {
      for (int block = 0; block < blocks_; ++block) {
        const auto [start, end] = BlockColumns(pattern.columns_px, blocks_, block);
        const float* factor = light.laser_irradiance_w_m2.Row(row);
        double mean = 0;
        for (int c = start; c < end; ++c) mean += factor[c] / static_cast<double>(end - start);
        for (int c = start; c < end; ++c) {
          pattern.At(row, c) = mean > 0 ? factor[c] / mean - 1 : 0;
        }
      }
    }
    const std::array<double, kLagCount> values = Autocovariance(pattern, first, sum, weights);
    drawn.back() = Eigen::Map<const Eigen::VectorXd>(values.data(), kLagCount);
  }
  if (!any) drawn.clear();
  return drawn;
}

Eigen::VectorXd FixedPatternStatistic::ExpectedPattern(const ExpectedSet& expected,
                                                       const Entry& entry) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLagCount);
  const FrameSetup& frame = expected.strips.front()[entry.frames.front()].frame;
  values[0] = std::pow(frame.sensor.prnu_relative, 2);
  for (const Eigen::VectorXd& drawn : DrawnPatterns(expected, entry)) values += drawn / kDraws;
  return values + ProductsAlongLine(expected, entry.frames, entry.roi.columns_px);
}

Eigen::VectorXd FixedPatternStatistic::ObservedDark(const RecordedSet& set,
                                                    const Entry& entry) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kDarkValues + entry.frames.size());
  std::vector<Image<double>> residuals;
  for (int f : entry.frames) {
    const Image<uint16_t>& raw = set.frames[f].raw_dn;
    if (raw.empty()) return values;
    // The median: hot pixels do not shift it.
    const double median = Median(raw.values);
    Image<double> residual(raw.columns_px, raw.rows_px);
    for (size_t i = 0; i < raw.values.size(); ++i) {
      residual.values[i] = (raw.values[i] - median) / entry.noise_dn;
    }
    residuals.push_back(std::move(residual));
  }
  for (size_t f = 0; f < residuals.size(); ++f) {
    double common = 0;
    for (size_t i = 0; i < residuals[f].values.size(); ++i) {
      common += residuals[f].values[i] > kDarkOutlier &&
                        residuals[entry.longest].values[i] > kDarkOutlier && f != entry.longest
                    ? 1
                    : 0;
    }
    values[kDarkValues + f] = 2 * std::sqrt(common + 0.375);
  }
  for (Image<double>& residual : residuals) {
    for (double& value : residual.values) value = Limited(value);
    SubtractRowMeans(residual);
  }
  const std::array<double, kDarkValues> products = DarkProducts(residuals);
  values[0] = products[0];
  values[1] = products[1];
  return values;
}

FixedPatternStatistic::DarkPattern FixedPatternStatistic::DarkPatternOf(const ExpectedSet& expected,
                                                                        const Entry& entry) const {
  DarkPattern pattern;
  if (std::none_of(
          expected.effects.begin(), expected.effects.end(),
          [](const ActiveEffect& active) { return active.effect->description().is_drawn; })) {
    return pattern;
  }
  for (int f : entry.frames) {
    FrameSetup patch = expected.strips.front()[f].frame;
    patch.roi = entry.roi;
    Image<double> electrons(patch.roi.columns_px, patch.roi.rows_px, 0.0);
    for (const ActiveEffect& active : expected.effects) {
      active.effect->OnMeanElectrons(electrons, nullptr, patch, active.parameters);
    }
    const double dark = patch.sensor.dark_mean_electrons + DarkCurrentElectrons(patch);
    for (double& e : electrons.values) e += dark;
    for (const ActiveEffect& active : expected.effects) {
      active.effect->OnElectrons(electrons, patch, active.parameters);
    }
    const auto [least, most] =
        std::minmax_element(electrons.values.begin(), electrons.values.end());
    pattern.even = pattern.even && *least == *most;
    const double median = *least == *most ? *least : Median(electrons.values);
    for (double& e : electrons.values) {
      e = patch.sensor.gain_dn_per_electron * (e - median) / entry.noise_dn;
    }
    pattern.frames.push_back(std::move(electrons));
  }
  return pattern;
}

Eigen::VectorXd FixedPatternStatistic::ExpectedDark(const ExpectedSet& expected,
                                                    const Entry& entry) const {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kDarkValues + entry.frames.size());
  const Sensor& sensor = expected.strips.front()[entry.frames.front()].frame.sensor;
  values[0] = std::pow(sensor.gain_dn_per_electron * sensor.dsnu_electrons / entry.noise_dn, 2);
  values.tail(values.size() - kDarkValues).setConstant(2 * std::sqrt(0.375));
  DarkPattern pattern = DarkPatternOf(expected, entry);
  if (pattern.even) return values;
  const Eigen::VectorXd counts = OutlierCounts(pattern.frames, entry.longest);
  values.tail(counts.size()) = 2 * (counts.array() + 0.375).sqrt();
  for (Image<double>& residual : pattern.frames) {
    for (double& value : residual.values) value = Limited(value);
    SubtractRowMeans(residual);
  }
  const std::array<double, kDarkValues> products = DarkProducts(pattern.frames);
  values[0] += products[0];
  values[1] += products[1];
  return values;
}

Eigen::MatrixXd FixedPatternStatistic::Covariance(const ExpectedSet& expected, int index) const {
  const Entry& entry = entries_[index];
  return entry.laser ? CovarianceOfPattern(expected, entry) : CovarianceInDark(expected, entry);
}

Eigen::MatrixXd FixedPatternStatistic::CovarianceInDark(const ExpectedSet& expected,
                                                        const Entry& entry) const {
  const Eigen::VectorXd values = ExpectedDark(expected, entry);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(values.size(), values.size());
  const size_t frames = entry.frames.size();
  const double area = static_cast<double>(entry.roi.columns_px) * entry.roi.rows_px;
  std::vector<double> variance;  // of a pixel, in units of the nominal noise
  for (int f : entry.frames) {
    const ExpectedFrame& strip = expected.strips.front()[f];
    variance.push_back((strip.noise_variance_dn2.At(0, 0) + strip.pattern_variance_dn2.At(0, 0)) /
                       (entry.noise_dn * entry.noise_dn));
  }
  double products = 0;
  for (size_t a = 0; a < frames; ++a) {
    for (size_t b = a + 1; b < frames; ++b) products += variance[a] * variance[b];
  }
  const double pairs = 0.5 * static_cast<double>(frames * (frames - 1));
  const double rows = entry.roi.rows_px;
  // With the scatter of a pattern that is drawn once.
  covariance(0, 0) = products / (pairs * pairs * area) + 2 * values[0] * values[0] / area +
                     2 * values[1] * values[1] / entry.roi.columns_px;
  covariance(1, 1) = products / (pairs * pairs * area * (rows - 1)) +
                     2 * values[1] * values[1] / entry.roi.columns_px;
  const auto count = static_cast<Eigen::Index>(frames);
  covariance.diagonal().tail(count).setOnes();
  const DarkPattern pattern = DarkPatternOf(expected, entry);
  if (pattern.even) return covariance;
  // One draw of the pattern is recorded, another one expected; that of counts is in the ones.
  const Eigen::MatrixXd drawn = ScatterOfDraws(pattern.frames, entry.longest);
  covariance(0, 0) += 2 * drawn(0, 0);
  covariance.block(kDarkValues, 0, count, 1) += 2 * drawn.block(1, 0, count, 1);
  covariance.block(0, kDarkValues, 1, count) += 2 * drawn.block(0, 1, 1, count);
  covariance.bottomRightCorner(count, count) += 2 * drawn.bottomRightCorner(count, count);
  covariance.diagonal().tail(count) -= drawn.diagonal().tail(count);
  return covariance;
}

Eigen::MatrixXd FixedPatternStatistic::CovarianceOfPattern(const ExpectedSet& expected,
                                                           const Entry& entry) const {
  const std::vector<RowWeights> weights = Weights(expected, entry);
  const std::vector<double> sum = Sum(weights);
  const std::array<double, kLagCount> total = TotalWeights(sum, weights, entry.roi);
  const double prnu = expected.strips.front()[entry.frames.front()].frame.sensor.prnu_relative;
  Eigen::MatrixXd covariance = OfSpeckleAndNoise(
      SpeckleOfResiduals(expected, entry.frames, weights), weights, total, entry.roi.columns_px);
  for (int l = 0; l < kLagCount; ++l) {
    covariance(l, l) += kPatternError * kPatternError;
    if (total[l] <= 0) {
      covariance(l, l) = 1;
    } else if (prnu > 0) {
      covariance(l, l) += ScatterOfSensitivity(prnu * prnu, l, sum, weights) * 0.5 *
                          entry.roi.columns_px / (total[l] * total[l]);
    }
  }
  // Recordings weigh by their light, here all alike.
  const Eigen::VectorXd along =
      kAlongError * ProductsAlongLine(expected, entry.frames, entry.roi.columns_px);
  covariance += along * along.transpose();
  covariance.diagonal() += along.cwiseAbs2();
  // One draw is seen, the mean of several expected.
  const std::vector<Eigen::VectorXd> drawn = DrawnPatterns(expected, entry);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(kLagCount);
  for (const Eigen::VectorXd& draw : drawn) mean += draw / kDraws;
  for (const Eigen::VectorXd& draw : drawn) {
    covariance += (draw - mean) * (draw - mean).transpose() / (kDraws - 1);
  }
  return covariance;
}

}  // namespace sightline
