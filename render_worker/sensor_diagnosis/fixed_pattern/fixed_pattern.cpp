// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/fixed_pattern/fixed_pattern.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/statistics/square.h"
#include "render_worker/sensor_diagnosis/fixed_pattern/smooth_course.h"

namespace sightline {
namespace {

// Upper quartile of the standard normal distribution.
constexpr double kQuartile = 0.6744897501960817;
// A step with a larger share of clipped pixels has no pattern of its own. Chosen.
constexpr double kLargestClippedShareOfPattern = 0.01;
// Smallest light, over the mean, by which deviations are divided: darker pixels are not informative
// about sensitivity. Chosen.
constexpr double kLeastLight = 0.01;

// The step with most frames; nullptr: none has enough.
const FlatFieldStatistics* MostFrames(const std::vector<const FlatFieldStatistics*>& steps) {
  const FlatFieldStatistics* most = nullptr;
  for (const FlatFieldStatistics* step : steps) {
    if (step->mean_dn.empty() || step->share_at_largest > kLargestClippedShareOfPattern) continue;
    if (!most || step->frames() > most->frames()) most = step;
  }
  return most;
}

double Range(const Image<double>& image) {
  const auto [least, most] = std::minmax_element(image.values.begin(), image.values.end());
  return *most - *least;
}

// Finds outliers by the quartiles, sets the variance of the other pixels, and replaces outliers by
// the midpoint of the quartiles, so that they do not look like a pattern of their column.
void SeparateOutliers(FixedPattern* pattern) {
  std::vector<double> sorted = pattern->deviation.values;
  const auto quarter = static_cast<std::ptrdiff_t>(sorted.size() / 4);
  std::nth_element(sorted.begin(), sorted.begin() + quarter, sorted.end());
  const double lower = *(sorted.begin() + quarter);
  std::nth_element(sorted.begin(), sorted.end() - 1 - quarter, sorted.end());
  const double upper = *(sorted.end() - 1 - quarter);
  const double centre = 0.5 * (lower + upper);
  const double deviation = std::max(0.5 * (upper - lower) / kQuartile, 1e-12);
  double sum = 0, squares = 0, count = 0;
  for (size_t i = 0; i < pattern->deviation.values.size(); ++i) {
    const double value = pattern->deviation.values[i];
    if (std::abs(value - centre) > kOutlierDeviations * deviation) {
      pattern->outliers.push_back(static_cast<int>(i));
      continue;
    }
    sum += value;
    squares += value * value;
    ++count;
  }
  pattern->variance = squares / count - Square(sum / count);
  for (const int i : pattern->outliers) pattern->deviation.values[i] = centre;
}

double NoiseOfAverage(const FlatFieldStatistics& step) {
  return step.noise.variance_1_apart_dn2->value / step.frames();
}

FixedPattern DarkPattern(const FlatFieldStatistics& dark) {
  FixedPattern pattern{.dark = true};
  const Image<double> smooth = SmoothCourse(dark.mean_dn);
  pattern.smooth_range = Range(smooth);
  pattern.deviation = dark.mean_dn;
  for (size_t i = 0; i < smooth.values.size(); ++i) {
    pattern.deviation.values[i] -= smooth.values[i];
  }
  pattern.noise_variance = NoiseOfAverage(dark);
  SeparateOutliers(&pattern);
  return pattern;
}

// `bright` is brighter than `dark` on average.
FixedPattern BrightPattern(const FlatFieldStatistics& bright, const FlatFieldStatistics& dark) {
  FixedPattern pattern{.dark = false};
  pattern.deviation = bright.mean_dn;
  const std::vector<double>& dark_dn = dark.mean_dn.values;
  double mean = 0;
  for (size_t i = 0; i < dark_dn.size(); ++i) {
    pattern.deviation.values[i] -= dark_dn[i];
    mean += pattern.deviation.values[i] / static_cast<double>(dark_dn.size());
  }
  const Image<double> smooth = SmoothCourse(pattern.deviation);
  pattern.smooth_range = Range(smooth) / mean;
  for (size_t i = 0; i < smooth.values.size(); ++i) {
    pattern.deviation.values[i] =
        pattern.deviation.values[i] / std::max(smooth.values[i], kLeastLight * mean) - 1;
  }
  pattern.noise_variance = (NoiseOfAverage(bright) + NoiseOfAverage(dark)) / Square(mean);
  SeparateOutliers(&pattern);
  return pattern;
}

}  // namespace

Estimate FixedPattern::Strength() const {
  const double n = static_cast<double>(deviation.values.size());
  const double square = std::max(0.0, variance - noise_variance);
  const double error = variance * std::sqrt(2 / n);
  return {std::sqrt(square), error / std::max(2 * std::sqrt(square), std::sqrt(error))};
}

FixedPatterns FindFixedPatterns(const FlatFieldSteps& steps) {
  const FlatFieldStatistics *dark = MostFrames(steps.dark), *bright = MostFrames(steps.bright);
  FixedPatterns patterns;
  if (dark) patterns.dark = DarkPattern(*dark);
  if (dark && bright) patterns.bright = BrightPattern(*bright, *dark);
  return patterns;
}

std::vector<double> ColumnMeans(const FixedPattern& pattern) {
  const Image<double>& d = pattern.deviation;
  std::vector<double> means(d.columns_px, 0);
  for (int row = 0; row < d.rows_px; ++row) {
    for (int column = 0; column < d.columns_px; ++column) {
      means[column] += d.At(row, column) / d.rows_px;
    }
  }
  return means;
}

std::vector<double> RowMeans(const FixedPattern& pattern) {
  const Image<double>& d = pattern.deviation;
  std::vector<double> means(d.rows_px, 0);
  for (int row = 0; row < d.rows_px; ++row) {
    for (int column = 0; column < d.columns_px; ++column) {
      means[row] += d.At(row, column) / d.columns_px;
    }
  }
  return means;
}

}  // namespace sightline
