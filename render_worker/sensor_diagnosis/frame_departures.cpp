// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/frame_departures.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>

#include "absl/strings/str_format.h"
#include "core/recordings/raw_numbers.h"
#include "render_worker/sensor_diagnosis/square.h"

namespace sightline {
namespace {

constexpr int kFewestFramesForDrift = 8;
constexpr int kFewestFramesForCorrelation = 4, kFewestStepsForDeficit = 10;
constexpr double kMaterialLight = 1e-3, kMaterialBlackLevel_dn = 0.1, kMaterialCarriedOver = 2e-3;
constexpr double kMaterialLineNoise = 0.01, kMaterialCorrelation = 2e-3;
constexpr double kMaterialMissing = 0.05, kMaterialCodeWidth = 0.02;
constexpr double kMaterialClipped = 1e-4;

double VarianceOf(const FlatFieldStatistics& step) {
  return step.noise.variance_1_apart_dn2->value;
}

// Variance of a frame's mean by the noise of its pixels.
double PixelNoiseOfMean(const FlatFieldStatistics& step) {
  return VarianceOf(step) / step.pair.pixels;
}

// Mean of values weighted by their errors.
struct Weighted {
  double weight = 0, sum = 0;
  void Add(double value, double error) {
    const double w = 1 / Square(std::max(error, 1e-300));
    weight += w;
    sum += w * value;
  }
  double Mean() const { return sum / weight; }
  double Error() const { return 1 / std::sqrt(weight); }
};

// Codes of the converter that are compared with one another, and their binomial weights.
constexpr std::array<double, 9> kEighthDifference = {1, 8, 28, 56, 70, 56, 28, 8, 1};
constexpr int64_t kFewestCountsOfCode = 100;
constexpr size_t kFewestCodeBlocks = 6;
constexpr double kOutlyingBlock = 4;  // standard errors

struct WidthOfBlock {
  double width, error;  // odd less even codes over both [1]
};

// The eighth difference of nine neighbouring counts vanishes for every smooth course of the
// histogram (a polynomial of up to the seventh degree), but not for codes that are alternately
// wide and narrow. The lowest and the highest code that occur are left out: they hold all that was
// clipped there.
std::vector<WidthOfBlock> WidthsOfBlocks(const Histogram& histogram, int largest) {
  const auto occurs = [](int64_t count) { return count > 0; };
  const auto lowest = std::find_if(histogram.begin(), histogram.end(), occurs);
  const auto highest = std::find_if(histogram.rbegin(), histogram.rend(), occurs);
  const int first = static_cast<int>(lowest - histogram.begin()) + 1;
  const int limit = std::min(largest, static_cast<int>(histogram.rend() - highest) - 1);
  constexpr int kCodes = static_cast<int>(kEighthDifference.size());
  std::vector<WidthOfBlock> blocks;
  int block = first;
  while (block + kCodes <= limit) {
    double excess = 0, total = 0, variance = 0;
    int rare = -1;
    for (int k = 0; k < kCodes; ++k) {
      const int code = block + k;
      if (histogram[code] < kFewestCountsOfCode) rare = code;
      const double count = static_cast<double>(histogram[code]);
      const double weight = kEighthDifference[k];
      excess += (code % 2 == 1 ? weight : -weight) * count;
      total += weight * count;
      variance += weight * weight * count;
    }
    if (rare >= 0) {
      block = rare + 1;
      continue;
    }
    blocks.push_back({excess / total, std::sqrt(variance) / total});
    block += kCodes;
  }
  return blocks;
}

double MiddleOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Differential nonlinearity with the period of two codes. Blocks of codes vote: a few that deviate
// for reasons of their own (clipping at several levels, a peak narrower than a code) are left out
// as outliers, since a converter's odd codes are wide over its whole range.
Departure OddEvenWidth(const Histogram& histogram, int largest) {
  Departure departure{.effect = "sensor.adc_inl", .stage = "readout"};
  const std::vector<WidthOfBlock> blocks = WidthsOfBlocks(histogram, largest);
  if (blocks.size() < kFewestCodeBlocks) {
    departure.testable = false;
    departure.description = absl::StrFormat(
        "needs at least %d ranges of %d numbers that all occur %d times, apart from the lowest and "
        "the highest number: more steps of different light",
        kFewestCodeBlocks, kEighthDifference.size(), kFewestCountsOfCode);
    return departure;
  }
  std::vector<double> widths, deviations;
  for (const WidthOfBlock& block : blocks) widths.push_back(block.width);
  const double middle = MiddleOf(widths);
  for (const double width : widths) deviations.push_back(std::abs(width - middle));
  // Standard error of a median, from the median deviation.
  const double middle_error =
      1.2533 * 1.4826 * MiddleOf(deviations) / std::sqrt(static_cast<double>(blocks.size()));
  // If all blocks scatter more than by chance, the bound for outliers is wider.
  std::vector<double> in_errors;
  for (const WidthOfBlock& block : blocks) {
    in_errors.push_back(std::abs(block.width - middle) / std::hypot(block.error, middle_error));
  }
  const double bound = kOutlyingBlock * std::max(1.0, 1.4826 * MiddleOf(in_errors));
  const auto agrees = [&](const WidthOfBlock& block) {
    return std::abs(block.width - middle) <= bound * std::hypot(block.error, middle_error);
  };
  Weighted mean;
  size_t used = 0;
  for (const WidthOfBlock& block : blocks) {
    if (!agrees(block)) continue;
    mean.Add(block.width, block.error);
    ++used;
  }
  if (used < std::max(kFewestCodeBlocks, blocks.size() / 2)) {
    departure.testable = false;
    departure.description =
        "ranges of numbers contradict one another: widths of odd and even "
        "numbers cannot be compared";
    return departure;
  }
  double chi_squared = 0;
  for (const WidthOfBlock& block : blocks) {
    if (agrees(block)) chi_squared += Square((block.width - mean.Mean()) / block.error);
  }
  const double scatter = std::sqrt(std::max(1.0, chi_squared / static_cast<double>(used - 1)));
  const double difference = 2 * mean.Mean(), error = 2 * scatter * mean.Error();
  departure.description = absl::StrFormat(
      "odd numbers are wider than even ones by %.3g of a step (differential nonlinearity)",
      difference);
  departure.p_value = TwoSidedP(difference / error);
  departure.material = std::abs(difference) > kMaterialCodeWidth;
  departure.parameters.push_back({"odd_minus_even_width", "DN", difference, error});
  return departure;
}

}  // namespace

double ScatterOfFrameMeans(std::span<const FlatFieldStatistics* const> steps) {
  double squares = 0, freedom = 0;
  for (const FlatFieldStatistics* step : steps) {
    const double mean = step->MeanDn();
    double square = 0;
    for (const double value : step->frame_mean_dn) square += Square(value - mean);
    squares += square - (step->frames() - 1) * PixelNoiseOfMean(*step);
    freedom += step->frames() - 1;
  }
  return freedom > 0 ? std::sqrt(std::max(0.0, squares / freedom)) : 0;
}

std::vector<Departure> FrameMeanDepartures(std::span<const FlatFieldStatistics* const> steps,
                                           bool dark) {
  const double material = dark ? kMaterialBlackLevel_dn : kMaterialLight;
  const std::string unit = dark ? "DN" : "";
  const char* shown = dark ? "DN" : "(relative)";
  double chi_squared = 0, freedom = 0, scatter = 0;
  const FlatFieldStatistics* longest = nullptr;
  for (const FlatFieldStatistics* step : steps) {
    const double mean = step->MeanDn();
    const double noise = std::max(PixelNoiseOfMean(*step), 1e-12);
    double square = 0;
    for (const double value : step->frame_mean_dn) square += Square(value - mean);
    chi_squared += square / noise;
    freedom += step->frames() - 1;
    scatter += std::max(0.0, square - (step->frames() - 1) * noise) / (dark ? 1 : Square(mean));
    if (!longest || step->frames() > longest->frames()) longest = step;
  }
  std::vector<Departure> departures;
  if (freedom == 0) return departures;
  const double flicker = std::sqrt(scatter / freedom);
  Departure changes{.effect = dark ? "black_level_noise" : "light_flicker",
                    .stage = dark ? "readout" : "illumination",
                    .description = absl::StrFormat(
                        "the %s changes from frame to frame by %.3g %s (standard deviation)",
                        dark ? "black level" : "light", flicker, shown),
                    .p_value = ChiSquaredTailP(chi_squared, freedom),
                    .material = flicker > material};
  changes.parameters.push_back(
      {"standard_deviation", unit, flicker, flicker / std::sqrt(2 * freedom)});
  departures.push_back(std::move(changes));

  Departure drift{.effect = dark ? "black_level_drift" : "light_drift", .stage = "time"};
  if (longest->frames() < kFewestFramesForDrift) {
    drift.testable = false;
    drift.description =
        absl::StrFormat("a drift shows in at least %d frames %s under the same conditions",
                        kFewestFramesForDrift, dark ? "in the dark" : "with light");
    departures.push_back(std::move(drift));
    return departures;
  }
  // Slope over the series, its error from the scatter about the line.
  const double n = longest->frames(), mean = longest->MeanDn();
  double xx = 0, xy = 0, rest = 0;
  for (int i = 0; i < longest->frames(); ++i) {
    const double x = i / (n - 1) - 0.5;
    xx += x * x;
    xy += x * (longest->frame_mean_dn[i] - mean);
  }
  const double slope = xy / xx;
  for (int i = 0; i < longest->frames(); ++i) {
    rest += Square(longest->frame_mean_dn[i] - mean - slope * (i / (n - 1) - 0.5));
  }
  const double error = std::sqrt(std::max(rest / (n - 2), PixelNoiseOfMean(*longest)) / xx);
  const double scale = dark ? 1 : mean;
  drift.description = absl::StrFormat("the %s drifts by %.3g %s over %.0f frames",
                                      dark ? "black level" : "light", slope / scale, shown, n);
  drift.p_value = TwoSidedP(slope / error);
  drift.material = std::abs(slope / scale) > material;
  drift.parameters.push_back({"drift_over_series", unit, slope / scale, error / scale});
  departures.push_back(std::move(drift));
  return departures;
}

Departure FrameCorrelation(std::span<const FlatFieldStatistics* const> steps) {
  Departure departure{.effect = "frame_correlation", .stage = "readout"};
  Weighted carried;
  for (const FlatFieldStatistics* step : steps) {
    if (step->frames() < kFewestFramesForCorrelation) continue;
    const Estimate& near = *step->noise.variance_1_apart_dn2;
    const Estimate& far = *step->noise.variance_2_apart_dn2;
    if (far.value <= 0) continue;
    // A frame of (1 - l) of its own signal and l of the one before has neighbours in time
    // correlated by about l; those two apart are not.
    const double ratio = near.value / far.value;
    const double error =
        std::hypot(near.standard_error / far.value, ratio * far.standard_error / far.value);
    carried.Add(1 - ratio, error);
  }
  if (carried.weight == 0) {
    departure.testable = false;
    departure.description =
        absl::StrFormat("needs at least %d consecutive frames with light under the same conditions",
                        kFewestFramesForCorrelation);
    return departure;
  }
  const double value = carried.Mean();
  departure.description = absl::StrFormat(
      "noise of consecutive frames is correlated by %.3g: the camera averages frames, or a part of "
      "the signal is carried over after the electrons are counted",
      value);
  departure.p_value = UpperTailP(value / carried.Error());
  departure.material = value > kMaterialCarriedOver;
  departure.parameters.push_back({"correlation", "", value, carried.Error()});
  return departure;
}

Departure FirstFrameDeficit(std::span<const FlatFieldStatistics* const> steps) {
  Departure departure{.effect = "first_frame_deficit", .stage = "time"};
  double n = 0, sum = 0, squares = 0;
  for (const FlatFieldStatistics* step : steps) {
    if (step->MeanDn() <= 0) continue;
    const double difference = (step->frame_mean_dn[1] - step->frame_mean_dn[0]) / step->MeanDn();
    ++n;
    sum += difference;
    squares += difference * difference;
  }
  if (n < kFewestStepsForDeficit) {
    departure.testable = false;
    departure.description =
        absl::StrFormat("needs at least %d steps with light", kFewestStepsForDeficit);
    return departure;
  }
  const double mean = sum / n;
  const double error = std::sqrt(std::max(squares / n - mean * mean, 1e-300) / (n - 1));
  departure.description = absl::StrFormat(
      "second frames are brighter than first ones by %.3g (relative, mean over the steps): charge "
      "of the frame before is left, or the light settles",
      mean);
  departure.p_value = TwoSidedP(mean / error);
  departure.material = std::abs(mean) > kMaterialLight;
  departure.parameters.push_back({"difference", "", mean, error});
  return departure;
}

std::vector<Departure> LineNoiseDepartures(std::span<const FlatFieldStatistics* const> dark) {
  std::vector<Departure> departures;
  for (const bool rows : {true, false}) {
    Weighted variance, pixel;
    for (const FlatFieldStatistics* step : dark) {
      const Estimate& line = rows ? step->noise.row_variance_dn2 : step->noise.column_variance_dn2;
      variance.Add(line.value, line.standard_error);
      pixel.Add(VarianceOf(*step), 1);
    }
    if (variance.weight == 0) continue;
    const double value = variance.Mean();
    const double strength = std::sqrt(std::max(0.0, value));
    Departure departure{
        .effect = rows ? "sensor.row_noise" : "column_noise",
        .stage = "readout",
        .description = absl::StrFormat(
            "all pixels of a %s share noise of %.3g DN (standard deviation) that changes from "
            "frame to frame",
            rows ? "row" : "column", strength),
        .p_value = UpperTailP(value / variance.Error()),
        .material = value > kMaterialLineNoise * pixel.Mean()};
    departure.parameters.push_back(
        {"standard_deviation", "DN", strength,
         variance.Error() / std::max(2 * strength, std::sqrt(variance.Error()))});
    departures.push_back(std::move(departure));
  }
  return departures;
}

std::vector<Departure> NeighbourDepartures(std::span<const FlatFieldStatistics* const> steps,
                                           std::span<const double> signal_dn) {
  std::vector<Departure> departures;
  double largest = 0, dark_variance = 0, brightest_variance = 0;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (steps[i]->dark) dark_variance = std::max(dark_variance, VarianceOf(*steps[i]));
    if (signal_dn[i] > largest) {
      largest = signal_dn[i];
      brightest_variance = VarianceOf(*steps[i]);
    }
  }
  if (largest <= 0 || brightest_variance <= 0) return departures;
  for (const bool in_row : {true, false}) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < steps.size(); ++i) {
      const TemporalNoise& noise = steps[i]->noise;
      const Estimate& covariance =
          in_row ? noise.covariance_in_row_dn2 : noise.covariance_in_column_dn2;
      // The scatter between parts of the image may be small by chance; white noise sets the least.
      const double error = std::max(covariance.standard_error,
                                    VarianceOf(*steps[i]) / std::sqrt(steps[i]->pair.pixels));
      const double u = signal_dn[i] / largest;
      const Eigen::Vector3d row(1, u, u * u);
      normal += row * row.transpose() / Square(error);
      right += row * covariance.value / Square(error);
    }
    const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
    if (solver.info() != Eigen::Success || solver.rcond() < 1e-12) continue;
    const Eigen::Vector3d c = solver.solve(right);
    const Eigen::Matrix3d covariance = solver.solve(Eigen::Matrix3d::Identity());
    const char* where = in_row ? "in a row" : "in a column";
    const char* suffix = in_row ? "_in_row" : "_in_column";
    const auto add = [&](const std::string& effect, const char* stage, const char* what, int k,
                         double variance) {
      const double correlation = c[k] / variance;
      const double error = std::sqrt(covariance(k, k)) / variance;
      Departure departure{
          .effect = effect,
          .stage = stage,
          .description = absl::StrFormat("noise of neighbours %s is correlated by %.3g %s", where,
                                         correlation, what),
          .p_value = TwoSidedP(correlation / error),
          .material = std::abs(correlation) > kMaterialCorrelation};
      departure.parameters.push_back({std::string("correlation") + suffix, "", correlation, error});
      departures.push_back(std::move(departure));
    };
    if (dark_variance > 0) {
      add(std::string("readout_correlation") + suffix, "readout", "in the dark", 0, dark_variance);
    }
    add(std::string("interpixel_coupling") + suffix, "sensor",
        "in proportion to the signal: a part of each pixel's signal is added to its neighbour's "
        "after the electrons are counted",
        1, brightest_variance);
    add("sensor.brighter_fatter", "sensor",
        "at the largest signal, growing with its square: charge pushes charge into the neighbour",
        2, brightest_variance);
  }
  return departures;
}

std::vector<Departure> ConverterDepartures(const std::vector<int64_t>& counts, int bit_depth_bit,
                                           double share_of_dark_at_zero) {
  std::vector<Departure> departures;
  Histogram histogram(65536, 0);
  std::copy(counts.begin(), counts.end(), histogram.begin());
  const int largest = (1 << bit_depth_bit) - 1;
  const int step = CommonPowerOfTwo(histogram);
  const double missing = MissingValueShare(histogram, UpperLimit(histogram, largest));
  Departure lost{.effect = "sensor.adc_missing_bits",
                 .stage = "readout",
                 .description = absl::StrFormat(
                     "numbers are multiples of %d; %.2g %% of those that should occur do not", step,
                     100 * missing),
                 // No chance is in it: each of these would be expected at least eight times.
                 .p_value = step > 1 || missing > kMaterialMissing ? 0.0 : 1.0,
                 .material = step > 1 || missing > kMaterialMissing};
  lost.parameters = {{"step", "DN", static_cast<double>(step), 0}, {"missing", "", missing, 0}};
  departures.push_back(std::move(lost));

  departures.push_back(OddEvenWidth(histogram, largest));
  Departure clipped{
      .effect = "black_level_clipped",
      .stage = "readout",
      .description = absl::StrFormat(
          "%.3g %% of the pixels are 0 in the dark: the black level is too low, dark noise and "
          "dark level are wrong by what is cut off",
          100 * share_of_dark_at_zero),
      .p_value = share_of_dark_at_zero > kMaterialClipped ? 0.0 : 1.0,
      .material = share_of_dark_at_zero > kMaterialClipped};
  clipped.parameters.push_back({"share_at_zero", "", share_of_dark_at_zero, 0});
  departures.push_back(std::move(clipped));
  return departures;
}

}  // namespace sightline
