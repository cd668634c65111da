// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/statistic/pattern/sensitivity_pattern.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "render_worker/diagnosis/statistic/pattern/pair_products.h"
#include "render_worker/diagnosis/statistic/pattern/product_covariance.h"
#include "render_worker/recordings/strips.h"

namespace sightline {

namespace {

// Residual squared relative signal, since samples represent segments. Chosen: a relative error of
// 0.3 %, below a usual PRNU.
constexpr double kPatternError = 1e-5;
// Relative error of the products of the light along the line. Chosen: recordings are weighted by
// their light, and the expectation weights them all alike.
constexpr double kAlongError = 0.1;
// Realisations of random patterns whose mean is the expectation. Chosen: their sampling error is a
// quarter of the pattern's own.
constexpr int kDraws = 16;

// Sum of products of an image's values in some columns with those a lag away.
double SumOfProducts(const Image<double>& image, const Lag& lag, const ColumnSpan& columns) {
  double total = 0;
  for (int row = 0; row + lag.rows < image.rows_px; ++row) {
    const double* here = image.Row(row);
    const double* there = image.Row(row + lag.rows) + lag.columns;
    for (int c = columns.first; c < columns.second; ++c) total += here[c] * there[c];
  }
  return total;
}

// Sum of all products of an image's values with those a lag away.
double SumOfProducts(const Image<double>& image, const Lag& lag) {
  return SumOfProducts(image, lag, {0, image.columns_px - lag.columns});
}

// Adds factor times the sum of products at every lag to each of the parts.
void AddProductsOfParts(const Image<double>& image, double factor,
                        std::vector<Eigen::VectorXd>& parts) {
  for (int part = 0; part < kObservedParts; ++part) {
    for (int l = 0; l < kLagCount; ++l) {
      for (const ColumnSpan& columns : ColumnsOfPart(image.columns_px, kLags[l].columns, part)) {
        parts[part][l] += factor * SumOfProducts(image, kLags[l], columns);
      }
    }
  }
}

// Deviations of every recording's light along the line from its segments' means; empty: one of them
// has no such light, or another number of positions.
std::vector<std::vector<double>> DeviationsAlongLine(const ExpectedSet& expected,
                                                     const std::vector<int>& frames) {
  std::vector<std::vector<double>> deviations;
  for (int f : frames) {
    std::vector<double> along;
    for (const std::vector<ExpectedFrame>& samples : expected.strips) {
      for (double level : samples[f].level_along_line) along.push_back(level - 1);
    }
    if (along.empty() || (!deviations.empty() && along.size() != deviations.front().size())) {
      return {};
    }
    deviations.push_back(std::move(along));
  }
  return deviations;
}

// Mean products, over pairs of recordings, of the light along the line about its segments' means.
// As far as it looks alike in all recordings, it is a pattern that stays on the sensor.
Eigen::VectorXd ProductsAlongLine(const ExpectedSet& expected, const std::vector<int>& frames,
                                  int columns_px) {
  Eigen::VectorXd products = Eigen::VectorXd::Zero(kLagCount);
  const std::vector<std::vector<double>> deviations = DeviationsAlongLine(expected, frames);
  if (deviations.empty()) return products;
  const size_t positions = deviations.front().size();
  for (int l = 0; l < kLagCount; ++l) {
    const double shift = kLags[l].columns * static_cast<double>(positions) / columns_px;
    const auto below = static_cast<size_t>(shift);
    const double part = shift - static_cast<double>(below);
    double count = 0;
    for (size_t i = 0; i + below + 1 < positions; ++i) {
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

// Weights of the rows by the expected light of one recording.
RowWeights ExpectedWeights(const ExpectedFrame& sample, const PatternGroup& group) {
  RowWeights weights(2 * static_cast<size_t>(group.roi.rows_px), 0);
  for (int row = 0; row < group.roi.rows_px; ++row) {
    for (int parity = 0; parity < 2; ++parity) {
      const double mean = sample.MeanDn(row, parity), signal = mean - group.offset_dn;
      if (signal < kLeastSignal_relative * sample.frame.sensor.largest_dn()) continue;
      double variance = sample.noise_variance_dn2.At(row, parity);
      for (const Image<float>& level : sample.level_dn) {
        variance +=
            std::pow(level.At(row, parity) - mean, 2) / static_cast<double>(sample.level_dn.size());
      }
      weights[2 * row + parity] = signal * signal / variance;
    }
  }
  return weights;
}

// Weights of every recording: as recorded, or expected for a planned set.
std::vector<RowWeights> WeightsOf(const ExpectedSet& expected, const PatternGroup& group) {
  if (!group.weights.empty()) return group.weights;
  std::vector<RowWeights> all;
  for (int f : group.frames) {
    all.push_back(ExpectedWeights(expected.strips[expected.strips.size() / 2][f], group));
  }
  return all;
}

// First row with any weight and one past the last; equal or reversed: none.
std::pair<int, int> WeightedRows(const RowWeights& sum, int rows_px) {
  int first = rows_px, last = 0;
  for (int row = 0; row < rows_px; ++row) {
    const size_t even = 2 * static_cast<size_t>(row);
    if (sum[even] + sum[even + 1] == 0) continue;
    first = std::min(first, row);
    last = row + 1;
  }
  return {first, last};
}

// Relative deviations of an image from the means of its rows' segments.
Image<double> RelativeToSegments(const Image<float>& light) {
  Image<double> pattern(light.columns_px, light.rows_px);
  for (int row = 0; row < pattern.rows_px; ++row) {
    const float* factor = light.Row(row);
    for (int segment = 0; segment < kPatternSegments; ++segment) {
      const auto [start, end] = BlockColumns(pattern.columns_px, kPatternSegments, segment);
      double mean = 0;
      for (int c = start; c < end; ++c) mean += factor[c] / static_cast<double>(end - start);
      for (int c = start; c < end; ++c) {
        pattern.At(row, c) = mean > 0 ? factor[c] / mean - 1 : 0;
      }
    }
  }
  return pattern;
}

// Autocovariances of the pattern that the effects make of uniform light, one per realisation of
// their random parts; empty: no effect makes one.
std::vector<Eigen::VectorXd> RandomPatterns(const ExpectedSet& expected,
                                            const PatternGroup& group) {
  std::vector<Eigen::VectorXd> autocovariances;
  if (expected.effects.empty()) return autocovariances;
  const std::vector<RowWeights> weights = WeightsOf(expected, group);
  const RowWeights sum = SumOfWeights(weights);
  const auto [first, last] = WeightedRows(sum, group.roi.rows_px);
  if (first >= last) return autocovariances;
  const FrameSetup& frame = expected.strips.front()[group.frames.front()].frame;
  bool any = false;
  for (int draw = 0; draw < kDraws; ++draw) {
    FrameSetup patch = frame;
    patch.roi = {group.roi.column_px, group.roi.row_px + first, group.roi.columns_px, last - first};
    patch.seeds.camera += draw;
    patch.seeds.rig += draw;
    PixelIrradiance light;
    light.roi = patch.roi;
    light.laser_irradiance_w_m2 = Image<float>(patch.roi.columns_px, patch.roi.rows_px, 1.0F);
    for (const ActiveEffect& active : expected.effects) {
      active.effect->OnPixelIrradiance(light, patch, active.parameters);
    }
    const std::vector<float>& factors = light.laser_irradiance_w_m2.values;
    autocovariances.push_back(Eigen::VectorXd::Zero(kLagCount));
    if (std::all_of(factors.begin(), factors.end(), [](float x) { return x == 1.0F; })) continue;
    any = true;
    const LagValues values =
        Autocovariance(RelativeToSegments(light.laser_irradiance_w_m2), first, sum, weights);
    autocovariances.back() = Eigen::Map<const Eigen::VectorXd>(values.data(), kLagCount);
  }
  if (!any) autocovariances.clear();
  return autocovariances;
}

}  // namespace

namespace {

RelativeResiduals ResidualsOf(const RecordedSet& set, const PatternGroup& group, int frame) {
  const RecordedFrame& recorded = set.frames[frame];
  return MakeRelativeResiduals(recorded.raw_dn, group.offset_dn,
                               recorded.nominal.sensor.largest_dn(), kPatternSegments);
}

}  // namespace

Eigen::VectorXd ObservedSensitivity(const RecordedSet& set, const PatternGroup& group) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLagCount);
  if (group.weights.empty()) return values;
  // Products of pairs are half the square of the sum minus half the sum of squares.
  Image<double> sum(group.roi.columns_px, group.roi.rows_px, 0.0);
  for (int f : group.frames) {
    const RelativeResiduals residuals = ResidualsOf(set, group, f);
    for (size_t i = 0; i < sum.values.size(); ++i) sum.values[i] += residuals.value.values[i];
    for (int l = 0; l < kLagCount; ++l) values[l] -= 0.5 * SumOfProducts(residuals.value, kLags[l]);
  }
  const LagValues total = TotalWeights(SumOfWeights(group.weights), group.weights, group.roi);
  for (int l = 0; l < kLagCount; ++l) {
    values[l] += 0.5 * SumOfProducts(sum, kLags[l]);
    values[l] = total[l] > 0 ? values[l] / total[l] : 0;
  }
  return values;
}

std::vector<Eigen::VectorXd> ObservedSensitivityOfParts(const RecordedSet& set,
                                                        const PatternGroup& group) {
  if (group.weights.empty()) return {};
  std::vector<Eigen::VectorXd> parts(kObservedParts, Eigen::VectorXd::Zero(kLagCount));
  // As in ObservedSensitivity; a part has its fraction of the columns and of the weights.
  Image<double> sum(group.roi.columns_px, group.roi.rows_px, 0.0);
  for (int f : group.frames) {
    const RelativeResiduals residuals = ResidualsOf(set, group, f);
    for (size_t i = 0; i < sum.values.size(); ++i) sum.values[i] += residuals.value.values[i];
    AddProductsOfParts(residuals.value, -0.5, parts);
  }
  AddProductsOfParts(sum, 0.5, parts);
  const LagValues total = TotalWeights(SumOfWeights(group.weights), group.weights, group.roi);
  for (int part = 0; part < kObservedParts; ++part) {
    for (int l = 0; l < kLagCount; ++l) {
      const int columns = group.roi.columns_px - kLags[l].columns;
      int of_part = 0;
      for (const auto& [first, last] :
           ColumnsOfPart(group.roi.columns_px, kLags[l].columns, part)) {
        of_part += last - first;
      }
      const double weight = total[l] * of_part / columns;
      parts[part][l] = weight > 0 ? parts[part][l] / weight : 0;
    }
  }
  return parts;
}

Eigen::VectorXd ExpectedSensitivity(const ExpectedSet& expected, const PatternGroup& group) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(kLagCount);
  const FrameSetup& frame = expected.strips.front()[group.frames.front()].frame;
  values[0] = std::pow(frame.sensor.prnu_relative, 2);
  for (const Eigen::VectorXd& pattern : RandomPatterns(expected, group)) values += pattern / kDraws;
  return values + ProductsAlongLine(expected, group.frames, group.roi.columns_px);
}

Eigen::MatrixXd CovarianceOfSensitivity(const ExpectedSet& expected, const PatternGroup& group) {
  const std::vector<RowWeights> weights = WeightsOf(expected, group);
  const RowWeights sum = SumOfWeights(weights);
  const LagValues total = TotalWeights(sum, weights, group.roi);
  const double prnu = expected.strips.front()[group.frames.front()].frame.sensor.prnu_relative;
  Eigen::MatrixXd covariance =
      CovarianceOfProducts(CorrelationsOfResiduals(expected, group.frames, weights), weights, total,
                           group.roi.columns_px);
  for (int l = 0; l < kLagCount; ++l) {
    covariance(l, l) += kPatternError * kPatternError;
    if (total[l] <= 0) {
      covariance(l, l) = 1;
    } else if (prnu > 0) {
      covariance(l, l) += VarianceBySensitivity(prnu * prnu, l, sum, weights) * 0.5 *
                          group.roi.columns_px / (total[l] * total[l]);
    }
  }
  const Eigen::VectorXd along =
      kAlongError * ProductsAlongLine(expected, group.frames, group.roi.columns_px);
  covariance += along * along.transpose();
  covariance.diagonal() += along.cwiseAbs2();
  // The recordings show one realisation of a random pattern; its variance is that of several.
  const std::vector<Eigen::VectorXd> patterns = RandomPatterns(expected, group);
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(kLagCount);
  for (const Eigen::VectorXd& pattern : patterns) mean += pattern / kDraws;
  for (const Eigen::VectorXd& pattern : patterns) {
    covariance += (pattern - mean) * (pattern - mean).transpose() / (kDraws - 1);
  }
  return covariance;
}

}  // namespace sightline
