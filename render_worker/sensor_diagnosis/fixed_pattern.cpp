// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/fixed_pattern.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <unsupported/Eigen/FFT>
#include <utility>

#include "absl/strings/str_format.h"
#include "render_worker/sensor_diagnosis/square.h"

namespace sightline {
namespace {

// Degree of the polynomial in row and column that stands for light and dark current over the
// sensor; the means of squares of this size are what it is fitted to.
constexpr int kDegree = 4;
constexpr int kMeansPerSide = 32;
// A normal number is that far out once in 5 10^8.
constexpr double kOutlierDeviations = 6;
// Quartiles of the normal law.
constexpr double kQuartile = 0.6744897501960817;
// Means of columns are compared with those of this many about them, so that what the polynomial
// leaves of the light is no pattern of columns.
constexpr int kNeighbours = 15;
constexpr double kMaterialShare = 0.1;
constexpr double kMaterialFallOff = 0.03;

// Legendre polynomials of a coordinate in [-1, 1], products up to the degree.
Eigen::VectorXd Basis(double x, double y) {
  double px[kDegree + 1] = {1, x}, py[kDegree + 1] = {1, y};
  for (int n = 1; n < kDegree; ++n) {
    px[n + 1] = ((2 * n + 1) * x * px[n] - n * px[n - 1]) / (n + 1);
    py[n + 1] = ((2 * n + 1) * y * py[n] - n * py[n - 1]) / (n + 1);
  }
  Eigen::VectorXd basis((kDegree + 1) * (kDegree + 2) / 2);
  Eigen::Index k = 0;
  for (int i = 0; i <= kDegree; ++i) {
    for (int j = 0; i + j <= kDegree; ++j) basis[k++] = px[i] * py[j];
  }
  return basis;
}

double Coordinate(double place, int size) { return 2 * (place + 0.5) / size - 1; }

// The smooth course: medians over cells of the image, through which the polynomial goes, so that
// single pixels far out do not matter.
Image<double> SmoothCourse(const Image<double>& image) {
  const int cells_down = std::min(kMeansPerSide, image.rows_px / 4);
  const int cells_across = std::min(kMeansPerSide, image.columns_px / 4);
  const Eigen::Index size = Basis(0, 0).size();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(size);
  std::vector<double> values;
  for (int i = 0; i < cells_down; ++i) {
    for (int j = 0; j < cells_across; ++j) {
      const int first_row = i * image.rows_px / cells_down;
      const int last_row = (i + 1) * image.rows_px / cells_down;
      const int first_column = j * image.columns_px / cells_across;
      const int last_column = (j + 1) * image.columns_px / cells_across;
      values.clear();
      for (int row = first_row; row < last_row; ++row) {
        for (int column = first_column; column < last_column; ++column) {
          values.push_back(image.At(row, column));
        }
      }
      // Mean of the middle half: as steady as the mean, nearly, and blind to what is far out.
      std::sort(values.begin(), values.end());
      const size_t low = values.size() / 4, high = values.size() - low;
      double sum = 0;
      for (size_t k = low; k < high; ++k) sum += values[k];
      const Eigen::VectorXd basis =
          Basis(Coordinate(0.5 * (first_column + last_column - 1), image.columns_px),
                Coordinate(0.5 * (first_row + last_row - 1), image.rows_px));
      normal += basis * basis.transpose();
      right += basis * (sum / static_cast<double>(high - low));
    }
  }
  // Two by two cells of the smallest images do not determine all of it; a little of a ridge keeps
  // the rest at zero.
  normal.diagonal().array() += 1e-9 * normal(0, 0);
  const Eigen::VectorXd coefficients = normal.ldlt().solve(right);
  Image<double> smooth(image.columns_px, image.rows_px);
  for (int row = 0; row < image.rows_px; ++row) {
    const double y = Coordinate(row, image.rows_px);
    // Along a row it is a polynomial of the column alone.
    for (int column = 0; column < image.columns_px; ++column) {
      smooth.At(row, column) = coefficients.dot(Basis(Coordinate(column, image.columns_px), y));
    }
  }
  return smooth;
}

// Variance by quartiles, outliers, and the variance again without them.
void MeasureSpread(FixedPattern* pattern) {
  std::vector<double> sorted = pattern->deviation.values;
  const size_t quarter = sorted.size() / 4;
  std::nth_element(sorted.begin(), sorted.begin() + quarter, sorted.end());
  const double lower = sorted[quarter];
  std::nth_element(sorted.begin(), sorted.end() - 1 - quarter, sorted.end());
  const double upper = sorted[sorted.size() - 1 - quarter];
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
  // An outlier would be taken for a pattern of its column.
  for (const int i : pattern->outliers) pattern->deviation.values[i] = centre;
}

double Range(const Image<double>& image) {
  const auto [least, most] = std::minmax_element(image.values.begin(), image.values.end());
  return *most - *least;
}

// Means less those of their neighbourhood.
std::vector<double> HighPass(const std::vector<double>& means) {
  const int n = static_cast<int>(means.size()), half = kNeighbours / 2;
  std::vector<double> result(means.size());
  for (int i = 0; i < n; ++i) {
    const int low = std::max(0, i - half), high = std::min(n - 1, i + half);
    double sum = 0;
    for (int k = low; k <= high; ++k) sum += means[k];
    result[i] = means[i] - sum / (high - low + 1);
  }
  return result;
}

struct Line {
  const char* kind;  // "column" or "row"
  std::vector<double> means;
  int pixels = 0;  // per mean
};

Departure PatternOfLines(const FixedPattern& pattern, const Line& line, bool dark) {
  const std::vector<double> means = HighPass(line.means);
  double square = 0;
  for (const double mean : means) square += Square(mean);
  const double n = static_cast<double>(means.size());
  // Of independent pixels: each mean has the part 1/pixels of their variance, of which the high
  // pass leaves 1 - 1/neighbours.
  const double expected = pattern.variance / line.pixels * (1 - 1.0 / kNeighbours);
  const double measured = square / n;
  const double strength = std::sqrt(std::max(0.0, measured - expected));
  const double error = expected * std::sqrt(2 / n) / std::max(2 * strength, std::sqrt(expected));
  const std::string what = absl::StrFormat("%s_%s_pattern", dark ? "dark" : "bright", line.kind);
  Departure departure{
      .effect = dark && line.kind == std::string("column") ? "sensor.dsnu_column_pattern" : what,
      .stage = "readout",
      .description =
          dark ? absl::StrFormat("%ss have offsets of their own: %.3g DN (standard deviation)",
                                 line.kind, strength)
               : absl::StrFormat(
                     "%ss have sensitivities of their own: %.3g (standard deviation, relative)",
                     line.kind, strength),
      .p_value = ChiSquaredTailP(n * measured / expected, n),
      .material = strength > kMaterialShare * std::sqrt(pattern.variance)};
  departure.parameters.push_back({what, dark ? "DN" : "", strength, error});
  return departure;
}

// The strongest frequency along the means.
Departure PeriodOfLines(const FixedPattern& pattern, const Line& line, bool dark) {
  std::vector<double> means = HighPass(line.means);
  const int n = static_cast<int>(means.size());
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> spectrum;
  fft.fwd(spectrum, means);
  // Below, the high pass has taken most of it.
  const int first = n / kNeighbours + 1, last = n / 2;
  std::vector<double> power;
  for (int k = first; k <= last; ++k) power.push_back(std::norm(spectrum[k]));
  std::vector<double> sorted = power;
  std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
  // Power of white noise has an exponential law; its median is ln 2 of the mean. A pattern of all
  // columns is white, too, so it raises no false alarm.
  const double mean = std::max(sorted[sorted.size() / 2] / std::numbers::ln2, 1e-300);
  // A pattern that is no sine has harmonics, which may be as strong: the period is that of the
  // lowest frequency of about the largest power.
  const double largest = *std::max_element(power.begin(), power.end());
  const auto peak = std::find_if(power.begin(), power.end(),
                                 [largest](double value) { return value >= 0.5 * largest; });
  const int k = first + static_cast<int>(peak - power.begin());
  const bool highest = 2 * k == n;  // one real number, not two: a square of one normal number
  const double amplitude = (highest ? 1 : 2) * std::sqrt(*peak) / n;
  const double ratio = *peak / mean;
  const double p = highest ? TwoSidedP(std::sqrt(ratio)) : std::exp(-ratio);
  Departure departure{
      .effect = absl::StrFormat("%s_%s_period", dark ? "dark" : "bright", line.kind),
      .stage = "readout",
      .description = absl::StrFormat(
          "a pattern repeats every %.4g %ss with an amplitude of %.3g %s",
          static_cast<double>(n) / k, line.kind, amplitude, dark ? "DN" : "(relative)"),
      .p_value = std::min(1.0, p * static_cast<double>(power.size())),
      .material = amplitude > kMaterialShare * std::sqrt(pattern.variance)};
  departure.parameters = {{"period", "px", static_cast<double>(n) / k, 0.5 * n / Square(k)},
                          {"amplitude", dark ? "DN" : "", amplitude, std::sqrt(mean) / n}};
  return departure;
}

// Pixels of odd and even rows and columns, as two converters or a colour filter give it.
Departure Checkerboard(const FixedPattern& pattern, bool dark) {
  const Image<double>& d = pattern.deviation;
  double sum[2][2] = {}, count[2][2] = {};
  for (int row = 0; row < d.rows_px; ++row) {
    for (int column = 0; column < d.columns_px; ++column) {
      sum[row % 2][column % 2] += d.At(row, column);
      count[row % 2][column % 2] += 1;
    }
  }
  double square = 0, largest = 0, least = 0;
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      const double mean = sum[i][j] / count[i][j];
      square += Square(mean) * count[i][j] / pattern.variance;
      largest = std::max(largest, mean);
      least = std::min(least, mean);
    }
  }
  const double difference = largest - least;
  Departure departure{.effect = dark ? "dark_cell_pattern" : "bright_cell_pattern",
                      .stage = "sensor",
                      .description = absl::StrFormat(
                          "cells of 2 x 2 pixels repeat: their pixels differ by up to %.3g %s%s",
                          difference, dark ? "DN" : "(relative)",
                          !dark && difference > 0.05
                              ? "; a colour filter does this, and then every colour has to be "
                                "evaluated by itself"
                              : ""),
                      .p_value = ChiSquaredTailP(square, 3),
                      .material = difference > kMaterialShare * std::sqrt(pattern.variance)};
  departure.parameters.push_back(
      {"difference", dark ? "DN" : "", difference, std::sqrt(2 * pattern.variance / count[0][0])});
  return departure;
}

Departure OutlierPixels(const FixedPattern& pattern, bool dark) {
  const double pixels = static_cast<double>(pattern.deviation.values.size());
  const double expected = pixels * TwoSidedP(kOutlierDeviations);
  const double count = static_cast<double>(pattern.outliers.size());
  Departure departure{
      .effect = dark ? "sensor.hot_pixels" : "defective_pixels",
      .stage = "sensor",
      .description = absl::StrFormat(
          "%.0f pixels (%.2g %%) lie more than %.0f standard deviations out %s", count,
          100 * count / pixels, kOutlierDeviations, dark ? "in the dark" : "in their sensitivity"),
      // Of a Poisson number.
      .p_value = count > 0 ? 1 - ChiSquaredTailP(2 * expected, 2 * count) : 1,
      .material = count > 0};
  departure.parameters.push_back({"pixels", "", count, std::sqrt(std::max(count, 1.0))});
  return departure;
}

}  // namespace

Estimate FixedPattern::Strength() const {
  const double n = static_cast<double>(deviation.values.size());
  const double square = std::max(0.0, variance - noise_variance);
  const double error = variance * std::sqrt(2 / n);
  return {std::sqrt(square), error / std::max(2 * std::sqrt(square), std::sqrt(error))};
}

FixedPattern DarkPattern(const Image<double>& dark_dn, double variance_dn2, int frames) {
  FixedPattern pattern;
  const Image<double> smooth = SmoothCourse(dark_dn);
  pattern.smooth_range = Range(smooth);
  pattern.deviation = dark_dn;
  for (size_t i = 0; i < smooth.values.size(); ++i) {
    pattern.deviation.values[i] -= smooth.values[i];
  }
  pattern.noise_variance = variance_dn2 / frames;
  MeasureSpread(&pattern);
  return pattern;
}

FixedPattern BrightPattern(const Image<double>& bright_dn, const Image<double>& dark_dn,
                           double bright_variance_dn2, double dark_variance_dn2, int frames,
                           int dark_frames) {
  FixedPattern pattern;
  pattern.deviation = bright_dn;
  double mean = 0;
  for (size_t i = 0; i < dark_dn.values.size(); ++i) {
    pattern.deviation.values[i] -= dark_dn.values[i];
    mean += pattern.deviation.values[i] / static_cast<double>(dark_dn.values.size());
  }
  const Image<double> smooth = SmoothCourse(pattern.deviation);
  pattern.smooth_range = Range(smooth) / mean;
  for (size_t i = 0; i < smooth.values.size(); ++i) {
    // Light that falls to a hundredth of its mean says nothing of sensitivity there.
    pattern.deviation.values[i] =
        pattern.deviation.values[i] / std::max(smooth.values[i], 0.01 * mean) - 1;
  }
  pattern.noise_variance =
      (bright_variance_dn2 / frames + dark_variance_dn2 / dark_frames) / Square(mean);
  MeasureSpread(&pattern);
  return pattern;
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

std::vector<Departure> PatternDepartures(const FixedPattern& pattern, bool dark) {
  std::vector<Departure> departures;
  for (const Line& line : {Line{"column", ColumnMeans(pattern), pattern.deviation.rows_px},
                           Line{"row", RowMeans(pattern), pattern.deviation.columns_px}}) {
    departures.push_back(PatternOfLines(pattern, line, dark));
    if (static_cast<int>(line.means.size()) >= 2 * kNeighbours) {
      departures.push_back(PeriodOfLines(pattern, line, dark));
    }
  }
  departures.push_back(Checkerboard(pattern, dark));
  departures.push_back(OutlierPixels(pattern, dark));
  return departures;
}

Departure LightFallOff(const FixedPattern& bright) {
  const double pixels = static_cast<double>(bright.deviation.values.size());
  const double error = std::sqrt(bright.variance * kMeansPerSide * kMeansPerSide / pixels);
  Departure departure{.effect = "light_fall_off",
                      .stage = "illumination",
                      .description = absl::StrFormat(
                          "the light is not uniform: it varies smoothly by %.3g %% over the sensor",
                          100 * bright.smooth_range),
                      .p_value = UpperTailP(bright.smooth_range / error - 2),
                      .material = bright.smooth_range > kMaterialFallOff};
  departure.parameters.push_back({"range", "", bright.smooth_range, error});
  return departure;
}

}  // namespace sightline
