// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/fixed_pattern/line_patterns.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <string>
#include <unsupported/Eigen/FFT>

#include "absl/strings/str_format.h"
#include "core/statistics/normal_distribution.h"
#include "core/statistics/order_statistics.h"
#include "core/statistics/square.h"
#include "render_worker/sensor_diagnosis/departure_names.h"

namespace sightline {
namespace {

// Means of lines are compared with those of this many around them, so that what the polynomial
// leaves of the light does not count as a pattern. Chosen.
constexpr int kNeighbours = 15;

enum class LineDirection { kColumn, kRow };

// Means of all columns or rows.
struct LineMeans {
  LineDirection direction;
  std::vector<double> means;
  int pixels = 0;  // per mean

  const char* Word() const { return direction == LineDirection::kColumn ? "column" : "row"; }
};

// Means less the moving average over kNeighbours lines.
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

const char* IlluminationWord(const FixedPattern& pattern) {
  return pattern.dark ? "dark" : "bright";
}

const char* UnitOf(const FixedPattern& pattern) { return pattern.dark ? "DN" : ""; }

Departure ValuesOfLines(const FixedPattern& pattern, const LineMeans& line) {
  const std::vector<double> means = HighPass(line.means);
  double square = 0;
  for (const double mean : means) square += Square(mean);
  const double n = static_cast<double>(means.size());
  // Means of independent pixels have 1/pixels of their variance, and the high pass leaves
  // 1 - 1/neighbours of it.
  const double expected = pattern.variance / line.pixels * (1 - 1.0 / kNeighbours);
  const double measured = square / n;
  const double strength = std::sqrt(std::max(0.0, measured - expected));
  const double error = expected * std::sqrt(2 / n) / std::max(2 * strength, std::sqrt(expected));
  const std::string name = absl::StrFormat("%s_%s_pattern", IlluminationWord(pattern), line.Word());
  const bool dark_columns = pattern.dark && line.direction == LineDirection::kColumn;
  Departure departure{
      .effect = dark_columns ? NamesInVocabulary().dark_column_pattern : name,
      .stage = "readout",
      .description =
          pattern.dark
              ? absl::StrFormat("%ss have offsets of their own: %.3g DN (standard deviation)",
                                line.Word(), strength)
              : absl::StrFormat(
                    "%ss have sensitivities of their own: %.3g (standard deviation, relative)",
                    line.Word(), strength),
      .p_value = ChiSquaredTailP(n * measured / expected, n),
      .material = strength > kMaterialPattern * std::sqrt(pattern.variance)};
  departure.parameters.push_back({name, UnitOf(pattern), strength, error});
  return departure;
}

// The largest line of a spectrum.
struct SpectralLine {
  int frequency = 1;    // cycles over all means
  double power = 0;     // squared modulus
  double mean = 1;      // of the power of white noise
  size_t searched = 0;  // number of frequencies
};

// A pattern that is not a sine has harmonics, which may be as strong: the line is the lowest
// frequency with at least half of the largest power. Frequencies that the high pass suppresses are
// left out.
SpectralLine LargestLine(const std::vector<double>& high_passed) {
  std::vector<double> means = high_passed;
  const int n = static_cast<int>(means.size());
  Eigen::FFT<double> fft;
  std::vector<std::complex<double>> spectrum;
  fft.fwd(spectrum, means);
  const int first = n / kNeighbours + 1, last = n / 2;
  std::vector<double> power;
  for (int k = first; k <= last; ++k) power.push_back(std::norm(spectrum[k]));
  const double median = UpperMedian(power);
  const double largest = *std::max_element(power.begin(), power.end());
  const auto peak = std::find_if(power.begin(), power.end(),
                                 [largest](double value) { return value >= 0.5 * largest; });
  // The power of white noise has an exponential distribution, whose median is ln 2 of its mean.
  // Independent values of all columns are white, too, and raise no false alarm.
  return {.frequency = first + static_cast<int>(peak - power.begin()),
          .power = *peak,
          .mean = std::max(median / std::numbers::ln2, 1e-300),
          .searched = power.size()};
}

Departure PeriodOfLines(const FixedPattern& pattern, const LineMeans& line) {
  const SpectralLine peak = LargestLine(HighPass(line.means));
  const int n = static_cast<int>(line.means.size()), k = peak.frequency;
  // The highest frequency has one real number instead of two: its power is the square of one normal
  // number.
  const bool highest = 2 * k == n;
  const double amplitude = (highest ? 1 : 2) * std::sqrt(peak.power) / n;
  const double ratio = peak.power / peak.mean;
  const double p = highest ? NormalTwoSidedTail(std::sqrt(ratio)) : std::exp(-ratio);
  const double period_px = static_cast<double>(n) / k;
  Departure departure{
      .effect = absl::StrFormat("%s_%s_period", IlluminationWord(pattern), line.Word()),
      .stage = "readout",
      .description =
          absl::StrFormat("a pattern repeats every %.4g %ss with an amplitude of %.3g %s",
                          period_px, line.Word(), amplitude, pattern.dark ? "DN" : "(relative)"),
      .p_value = std::min(1.0, p * static_cast<double>(peak.searched)),
      .material = amplitude > kMaterialPattern * std::sqrt(pattern.variance)};
  departure.parameters = {{"period", "px", period_px, 0.5 * n / Square(k)},
                          {"amplitude", UnitOf(pattern), amplitude, std::sqrt(peak.mean) / n}};
  return departure;
}

}  // namespace

std::vector<Departure> LinePatterns(const FixedPattern& pattern) {
  const Image<double>& image = pattern.deviation;
  std::vector<Departure> departures;
  for (const LineMeans& line :
       {LineMeans{LineDirection::kColumn, ColumnMeans(pattern), image.rows_px},
        LineMeans{LineDirection::kRow, RowMeans(pattern), image.columns_px}}) {
    departures.push_back(ValuesOfLines(pattern, line));
    if (static_cast<int>(line.means.size()) < 2 * kNeighbours) continue;
    departures.push_back(PeriodOfLines(pattern, line));
  }
  return departures;
}

}  // namespace sightline
