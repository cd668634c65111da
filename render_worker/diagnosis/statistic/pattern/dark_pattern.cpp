// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/pattern/dark_pattern.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/statistics/order_statistics.h"
#include "render_worker/diagnosis/statistic/pattern/dark_outliers.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Offsets of rows may change from frame to frame; they are no fixed pattern.
void SubtractRowMeans(Image<double>& image) {
  for (int row = 0; row < image.rows_px; ++row) {
    double sum = 0;
    for (int c = 0; c < image.columns_px; ++c) sum += image.At(row, c);
    for (int c = 0; c < image.columns_px; ++c) image.At(row, c) -= sum / image.columns_px;
  }
}

// Sum of values and of their squares. The sum of products over all pairs is half the square of the
// one minus half the other.
struct PairSums {
  double sum = 0, squares = 0;

  void Add(double value) {
    sum += value;
    squares += value * value;
  }
  double Products() const { return 0.5 * (sum * sum - squares); }
};

// Clips residuals and removes their rows' means.
void PrepareForProducts(std::vector<Image<double>>& frames) {
  for (Image<double>& residual : frames) {
    for (double& value : residual.values) value = ClippedResidual(value);
    SubtractRowMeans(residual);
  }
}

// Components 0 and 1 of some columns. `frames`: PrepareForProducts.
std::array<double, kDarkProducts> DarkProducts(const std::vector<Image<double>>& frames,
                                               const std::vector<ColumnSpan>& spans) {
  int columns = 0;
  const int rows = frames.front().rows_px;
  double pixels = 0, column_means = 0;
  std::vector<double> total(frames.size());
  for (const auto& [first, last] : spans) {
    columns += last - first;
    for (int c = first; c < last; ++c) {
      std::fill(total.begin(), total.end(), 0);
      for (int row = 0; row < rows; ++row) {
        PairSums sums;
        for (size_t f = 0; f < frames.size(); ++f) {
          const double value = frames[f].At(row, c);
          sums.Add(value);
          total[f] += value;
        }
        pixels += sums.Products();
      }
      PairSums sums;
      for (double value : total) sums.Add(value);
      column_means += sums.Products();
    }
  }
  const double pairs = 0.5 * static_cast<double>(frames.size() * (frames.size() - 1));
  const double area = static_cast<double>(columns) * rows;
  // Without the pixels' own part, only products of different rows of a column remain.
  return {pixels / (pairs * area),
          rows > 1 ? (column_means - pixels) / (pairs * area * (rows - 1)) : 0};
}

// A realisation of what the effects add to dark frames, in units of the nominal dark noise.
struct RandomDarkPattern {
  std::vector<Image<double>> frames;
  bool uniform = true;  // in every frame
};

RandomDarkPattern RealiseDarkPattern(const ExpectedSet& expected, const PatternGroup& group) {
  RandomDarkPattern pattern;
  // A gain that alternates multiplies the dark charge, too.
  const bool uneven =
      std::any_of(expected.effects.begin(), expected.effects.end(), [](const ActiveEffect& active) {
        const EffectDescription& description = active.effect->description();
        return description.VariesOverSensor() || description.columns_alternate;
      });
  if (!uneven) return pattern;
  for (int f : group.frames) {
    FrameSetup patch = expected.strips.front()[f].frame;
    patch.roi = group.roi;
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
    pattern.uniform = pattern.uniform && *least == *most;
    const double median = *least == *most ? *least : UpperMedian(electrons.values);
    for (double& e : electrons.values) {
      e = patch.sensor.gain_dn_per_electron * (e - median) / group.noise_dn;
    }
    pattern.frames.push_back(std::move(electrons));
  }
  return pattern;
}

// Differences of every recording from its median, in units of the nominal noise; empty: the set is
// only planned.
std::vector<Image<double>> DarkResiduals(const RecordedSet& set, const PatternGroup& group) {
  std::vector<Image<double>> residuals;
  for (int f : group.frames) {
    const Image<uint16_t>& raw = set.frames[f].raw_dn;
    if (raw.empty()) return {};
    // Hot pixels do not change the median.
    const double median = UpperMedian(raw.values);
    Image<double> residual(raw.columns_px, raw.rows_px);
    for (size_t i = 0; i < raw.values.size(); ++i) {
      residual.values[i] = (raw.values[i] - median) / group.noise_dn;
    }
    residuals.push_back(std::move(residual));
  }
  return residuals;
}

}  // namespace

Eigen::VectorXd ObservedDarkPattern(const RecordedSet& set, const PatternGroup& group) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kDarkProducts + group.frames.size());
  std::vector<Image<double>> residuals = DarkResiduals(set, group);
  if (residuals.empty()) return values;
  for (size_t f = 0; f < residuals.size(); ++f) {
    double common = 0;
    for (size_t i = 0; i < residuals[f].values.size(); ++i) {
      common += residuals[f].values[i] > kDarkOutlier &&
                        residuals[group.longest].values[i] > kDarkOutlier && f != group.longest
                    ? 1
                    : 0;
    }
    values[kDarkProducts + f] = 2 * std::sqrt(common + kAnscombe);
  }
  PrepareForProducts(residuals);
  const std::array<double, kDarkProducts> products =
      DarkProducts(residuals, {{0, group.roi.columns_px}});
  values[0] = products[0];
  values[1] = products[1];
  return values;
}

std::vector<Eigen::VectorXd> ObservedDarkPatternOfParts(const RecordedSet& set,
                                                        const PatternGroup& group) {
  std::vector<Image<double>> residuals = DarkResiduals(set, group);
  if (residuals.empty()) return {};
  PrepareForProducts(residuals);
  std::vector<Eigen::VectorXd> parts;
  for (int part = 0; part < kObservedParts; ++part) {
    const std::array<double, kDarkProducts> products =
        DarkProducts(residuals, ColumnsOfPart(group.roi.columns_px, 0, part));
    parts.push_back(Eigen::Map<const Eigen::VectorXd>(products.data(), kDarkProducts));
  }
  return parts;
}

Eigen::VectorXd ExpectedDarkPattern(const ExpectedSet& expected, const PatternGroup& group) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kDarkProducts + group.frames.size());
  const Sensor& sensor = expected.strips.front()[group.frames.front()].frame.sensor;
  values[0] = std::pow(sensor.gain_dn_per_electron * sensor.dsnu_electrons / group.noise_dn, 2);
  values.tail(values.size() - kDarkProducts).setConstant(2 * std::sqrt(kAnscombe));
  RandomDarkPattern pattern = RealiseDarkPattern(expected, group);
  if (pattern.uniform) return values;
  const Eigen::VectorXd counts = OutlierCounts(pattern.frames, group.longest);
  values.tail(counts.size()) = 2 * (counts.array() + kAnscombe).sqrt();
  PrepareForProducts(pattern.frames);
  const std::array<double, kDarkProducts> products =
      DarkProducts(pattern.frames, {{0, group.roi.columns_px}});
  values[0] += products[0];
  values[1] += products[1];
  return values;
}

Eigen::MatrixXd CovarianceOfDarkPattern(const ExpectedSet& expected, const PatternGroup& group) {
  const Eigen::VectorXd values = ExpectedDarkPattern(expected, group);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(values.size(), values.size());
  const size_t frames = group.frames.size();
  const double area = static_cast<double>(group.roi.columns_px) * group.roi.rows_px;
  std::vector<double> variance;  // of a pixel, in units of the nominal noise
  for (int f : group.frames) {
    const ExpectedFrame& sample = expected.strips.front()[f];
    variance.push_back((sample.noise_variance_dn2.At(0, 0) + sample.pattern_variance_dn2.At(0, 0)) /
                       (group.noise_dn * group.noise_dn));
  }
  double products = 0;
  for (size_t a = 0; a < frames; ++a) {
    for (size_t b = a + 1; b < frames; ++b) products += variance[a] * variance[b];
  }
  const double pairs = 0.5 * static_cast<double>(frames * (frames - 1));
  const double rows = group.roi.rows_px;
  // The second and third terms are the sampling variance of a pattern with these variances.
  covariance(0, 0) = products / (pairs * pairs * area) + 2 * values[0] * values[0] / area +
                     2 * values[1] * values[1] / group.roi.columns_px;
  covariance(1, 1) = products / (pairs * pairs * area * (rows - 1)) +
                     2 * values[1] * values[1] / group.roi.columns_px;
  const auto count = static_cast<Eigen::Index>(frames);
  covariance.diagonal().tail(count).setOnes();
  const RandomDarkPattern pattern = RealiseDarkPattern(expected, group);
  if (pattern.uniform) return covariance;
  // One realisation is recorded and another one expected, so their covariance counts twice. The
  // ones on the diagonal contain that of the recorded counts already.
  const Eigen::MatrixXd realised = CovarianceOfRealisations(pattern.frames, group.longest);
  covariance(0, 0) += 2 * realised(0, 0);
  covariance.block(kDarkProducts, 0, count, 1) += 2 * realised.block(1, 0, count, 1);
  covariance.block(0, kDarkProducts, 1, count) += 2 * realised.block(0, 1, 1, count);
  covariance.bottomRightCorner(count, count) += 2 * realised.bottomRightCorner(count, count);
  covariance.diagonal().tail(count) -= realised.diagonal().tail(count);
  return covariance;
}

}  // namespace sightline
