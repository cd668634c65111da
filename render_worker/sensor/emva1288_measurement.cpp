// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/emva1288_measurement.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "core/statistics/square.h"

namespace sightline {
namespace {

constexpr double kQuantisationVariance_dn2 = 1.0 / 12;
// Below this variance quantisation hides the dark noise (clause 6.6).
constexpr double kLeastDarkVariance_dn2 = 0.24;

absl::Status Error(const std::string& reason) {
  return absl::InvalidArgumentError(absl::StrCat("EMVA 1288: ", reason));
}

// Variance of a temporal variance that comes from one pair: chi-squared of `pixels` - 1.
double VarianceOfVariance(const PairStatistics& pair) {
  return 2 * Square(pair.temporal_variance_dn2) / (pair.pixels - 1);
}

// Variance of a pair's mean; the fixed pattern is not in it.
double VarianceOfMean(const PairStatistics& pair) {
  return pair.temporal_variance_dn2 / (2 * pair.pixels);
}

// Weighted least squares y = offset + slope x with known standard errors of y.
struct Line {
  Estimate offset, slope;
};
Line FitLine(std::span<const double> x, std::span<const double> y, std::span<const double> error) {
  double w = 0, wx = 0, wxx = 0, wy = 0, wxy = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    const double weight = 1 / Square(error[i]);
    w += weight;
    wx += weight * x[i];
    wxx += weight * x[i] * x[i];
    wy += weight * y[i];
    wxy += weight * x[i] * y[i];
  }
  const double determinant = w * wxx - wx * wx;
  return {{(wxx * wy - wx * wxy) / determinant, std::sqrt(wxx / determinant)},
          {(w * wxy - wx * wy) / determinant, std::sqrt(w / determinant)}};
}

// Least squares y = slope x, and the slope's error from known variances of y.
Estimate FitSlope(std::span<const double> x, std::span<const double> y,
                  std::span<const double> variance) {
  double xx = 0, xy = 0, error = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    xx += x[i] * x[i];
    xy += x[i] * y[i];
    error += x[i] * x[i] * variance[i];
  }
  return {xy / xx, std::sqrt(error) / xx};
}

int CountDifferent(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return static_cast<int>(std::unique(values.begin(), values.end()) - values.begin());
}

// Saturation point (clause 6.6): coming from the highest exposure, the first variance that is above
// the two before it. Of those below half the largest, in deep saturation, none counts.
int SaturationStep(std::span<const ExposureStep> steps) {
  double largest = 0;
  for (const ExposureStep& step : steps) {
    largest = std::max(largest, step.bright.temporal_variance_dn2);
  }
  const auto variance = [&](int i) { return steps[i].bright.temporal_variance_dn2; };
  for (int i = static_cast<int>(steps.size()) - 1; i >= 2; --i) {
    if (variance(i) > largest / 2 && variance(i) > variance(i - 1) &&
        variance(i) > variance(i - 2)) {
      return i;
    }
  }
  return -1;
}

// Temporal variance without light at exposure time 0: intercept if the exposure times differ.
Estimate DarkVariance(std::span<const ExposureStep> steps) {
  std::vector<double> time, variance, error;
  double mean = 0, mean_error = 0;
  for (const ExposureStep& step : steps) {
    time.push_back(step.exposure_time_s);
    variance.push_back(step.dark.temporal_variance_dn2);
    // A dark frame without any noise still has a weight.
    error.push_back(std::sqrt(std::max(VarianceOfVariance(step.dark), 1e-12)));
    mean += variance.back() / steps.size();
    mean_error += Square(error.back() / steps.size());
  }
  if (CountDifferent(time) < 2) return {mean, std::sqrt(mean_error)};
  return FitLine(time, variance, error).offset;
}

void MeasureLinearity(std::span<const ExposureStep> steps, double saturation_dn,
                      PhotonTransfer* result) {
  std::vector<double> photons, signal, noise;
  for (const ExposureStep& step : steps) {
    const double y = step.bright.mean_dn - step.dark.mean_dn;
    if (y < 0.05 * saturation_dn || y > 0.95 * saturation_dn) continue;
    photons.push_back(step.photons);
    signal.push_back(y);
    noise.push_back(std::sqrt(VarianceOfMean(step.bright) + VarianceOfMean(step.dark)));
  }
  // Least relative squares: every value counts by its own size.
  const Line line = FitLine(photons, signal, signal);
  double sum = 0, noise_sum = 0;
  result->linearity_error_min_relative = result->linearity_error_max_relative = 0;
  for (size_t i = 0; i < photons.size(); ++i) {
    const double fit = line.offset.value + line.slope.value * photons[i];
    const double deviation = (signal[i] - fit) / fit;
    sum += std::abs(deviation);
    noise_sum += noise[i] / fit;
    result->linearity_error_min_relative =
        std::min(result->linearity_error_min_relative, deviation);
    result->linearity_error_max_relative =
        std::max(result->linearity_error_max_relative, deviation);
  }
  const double count = static_cast<double>(photons.size());
  result->linearity_error_relative = sum / count;
  // Mean magnitude of a normal number; two parameters are fitted.
  result->linearity_noise_relative =
      std::sqrt(2 / std::numbers::pi) * noise_sum / count * std::sqrt(1 - 2 / count);
}

}  // namespace

Image<uint16_t> ChannelPixels(const Image<uint16_t>& raw_dn, const Sensor& sensor,
                              const RegionOfInterest& roi, int channel) {
  if (sensor.colour_filter == ColourFilter::kMono) return raw_dn;
  assert(raw_dn.rows_px % 2 == 0 && raw_dn.columns_px % 2 == 0);
  Image<uint16_t> pixels(raw_dn.columns_px / 2, raw_dn.rows_px / (channel == kGreen ? 1 : 2));
  size_t next = 0;
  for (int row = 0; row < raw_dn.rows_px; ++row) {
    for (int column = 0; column < raw_dn.columns_px; ++column) {
      if (sensor.ChannelAt(roi.row_px + row, roi.column_px + column) == channel) {
        pixels.values[next++] = raw_dn.At(row, column);
      }
    }
  }
  return pixels;
}

PairStatistics StatisticsOfPair(const Image<uint16_t>& first_dn, const Image<uint16_t>& second_dn) {
  assert(first_dn.values.size() == second_dn.values.size() && first_dn.values.size() > 1);
  // Whole numbers: exact sums.
  uint64_t sum_a = 0, sum_b = 0, sum_ab = 0, sum_dd = 0;
  for (size_t i = 0; i < first_dn.values.size(); ++i) {
    const uint64_t a = first_dn.values[i], b = second_dn.values[i];
    sum_a += a;
    sum_b += b;
    sum_ab += a * b;
    sum_dd += a > b ? (a - b) * (a - b) : (b - a) * (b - a);
  }
  PairStatistics pair;
  const double n = pair.pixels = static_cast<double>(first_dn.values.size());
  const double mean_a = sum_a / n, mean_b = sum_b / n;
  pair.mean_dn = (mean_a + mean_b) / 2;
  pair.temporal_variance_dn2 = (sum_dd / n - Square(mean_a - mean_b)) / 2 * n / (n - 1);
  pair.spatial_variance_dn2 = (sum_ab / n - mean_a * mean_b) * n / (n - 1);
  return pair;
}

absl::StatusOr<PhotonTransfer> MeasurePhotonTransfer(std::span<const ExposureStep> steps) {
  if (steps.size() < 20) {
    return Error(absl::StrCat("photon transfer has ", steps.size(),
                              " exposure steps, must have at least 20"));
  }
  for (size_t i = 1; i < steps.size(); ++i) {
    if (!(steps[i].photons > steps[i - 1].photons)) {
      return Error(absl::StrCat("photons of step ", i, ", ", steps[i].photons,
                                ", must be above those of the step before it, ",
                                steps[i - 1].photons));
    }
  }
  const int saturated = SaturationStep(steps);
  if (saturated < 0 || saturated + 1 == static_cast<int>(steps.size())) {
    return Error("the variance has no maximum: exposures must reach beyond saturation");
  }
  const auto signal = [](const ExposureStep& step) {
    return step.bright.mean_dn - step.dark.mean_dn;
  };
  const double saturation_dn = signal(steps[saturated]);

  std::vector<double> photons, means, mean_variances, variances, variance_variances;
  const ExposureStep* brightest = nullptr;
  for (int i = 0; i <= saturated; ++i) {
    if (signal(steps[i]) > 0.7 * saturation_dn) continue;
    const PairStatistics &bright = steps[i].bright, &dark = steps[i].dark;
    brightest = &steps[i];
    photons.push_back(steps[i].photons);
    means.push_back(signal(steps[i]));
    mean_variances.push_back(VarianceOfMean(bright) + VarianceOfMean(dark));
    variances.push_back(bright.temporal_variance_dn2 - dark.temporal_variance_dn2);
    variance_variances.push_back(VarianceOfVariance(bright) + VarianceOfVariance(dark));
  }
  if (brightest == nullptr || photons.size() < 5) {
    return Error(absl::StrCat("only ", photons.size(),
                              " exposure steps below 70 % of saturation, must be at least 5"));
  }
  PhotonTransfer result;
  Estimate& r = result.responsivity_dn_per_photon;
  r = FitSlope(photons, means, mean_variances);
  // Sensitivities of a finite number of pixels: their mean is the same in all steps.
  const double pattern_dn2 =
      std::max(brightest->bright.spatial_variance_dn2 - brightest->dark.spatial_variance_dn2, 0.0);
  r.standard_error =
      std::hypot(r.standard_error,
                 r.value * std::sqrt(pattern_dn2 / brightest->bright.pixels) / signal(*brightest));
  // The means' errors, a hundredth of the variances', are left out.
  Estimate& k = result.gain_dn_per_electron;
  k = FitSlope(means, variances, variance_variances);
  if (!(k.value > 0) || !(r.value > 0)) return Error("the signal does not grow with the exposure");
  Estimate& eta = result.quantum_efficiency;
  eta.value = r.value / k.value;
  eta.standard_error =
      eta.value * std::hypot(r.standard_error / r.value, k.standard_error / k.value);

  const Estimate dark = DarkVariance(steps);
  result.dark_noise_is_upper_bound = dark.value < kLeastDarkVariance_dn2;
  const double dark_dn2 = std::max(dark.value, kLeastDarkVariance_dn2) - kQuantisationVariance_dn2;
  Estimate& sigma_d = result.dark_noise_electrons;
  sigma_d.value = std::sqrt(dark_dn2) / k.value;
  sigma_d.standard_error =
      sigma_d.value * std::hypot(dark.standard_error / (2 * dark_dn2), k.standard_error / k.value);

  // The maximum lies between the neighbouring steps: uniform law.
  Estimate& sat = result.saturation_photons;
  sat.value = steps[saturated].photons;
  sat.standard_error =
      (steps[saturated + 1].photons - steps[saturated - 1].photons) / 2 / std::sqrt(3.0);
  Estimate& sat_e = result.saturation_capacity_electrons;
  sat_e.value = eta.value * sat.value;
  sat_e.standard_error =
      sat_e.value * std::hypot(sat.standard_error / sat.value, eta.standard_error / eta.value);

  // SNR = 1 (clause 2.5).
  const double total_dark = std::max(dark.value, kLeastDarkVariance_dn2) / Square(k.value);
  Estimate& threshold = result.sensitivity_threshold_photons;
  threshold.value = (std::sqrt(total_dark + 0.25) + 0.5) / eta.value;
  threshold.standard_error = threshold.value * std::hypot(eta.standard_error / eta.value,
                                                          sigma_d.standard_error / sigma_d.value);
  result.dynamic_range = sat.value / threshold.value;
  result.largest_snr = std::sqrt(sat_e.value);
  MeasureLinearity(steps, saturation_dn, &result);
  return result;
}

absl::StatusOr<DarkCurrent> MeasureDarkCurrent(std::span<const DarkStep> steps,
                                               const Estimate& gain_dn_per_electron) {
  std::vector<double> time, mean, mean_error, variance, variance_error;
  for (const DarkStep& step : steps) {
    time.push_back(step.exposure_time_s);
    mean.push_back(step.dark.mean_dn);
    mean_error.push_back(std::sqrt(std::max(VarianceOfMean(step.dark), 1e-12)));
    variance.push_back(step.dark.temporal_variance_dn2);
    variance_error.push_back(std::sqrt(std::max(VarianceOfVariance(step.dark), 1e-12)));
  }
  if (const int different = CountDifferent(time); different < 3) {
    return Error(absl::StrCat("dark current from ", different,
                              " exposure times, must be at least 3 different ones"));
  }
  // value / K^power; the gain's error is common to all steps.
  const auto in_electrons = [&](const Estimate& dn, double power) {
    const double k = gain_dn_per_electron.value;
    const double value = dn.value / std::pow(k, power);
    return Estimate{value, std::hypot(dn.standard_error / std::pow(k, power),
                                      power * value * gain_dn_per_electron.standard_error / k)};
  };
  const Line mean_line = FitLine(time, mean, mean_error);
  const Line variance_line = FitLine(time, variance, variance_error);
  return DarkCurrent{in_electrons(mean_line.slope, 1), in_electrons(variance_line.slope, 2),
                     in_electrons(mean_line.offset, 1)};
}

absl::StatusOr<DarkCurrentOverTemperature> MeasureDoublingTemperature(
    std::span<const TemperatureStep> steps, double reference_temperature_c) {
  std::vector<double> kelvin, doublings, error;
  for (const TemperatureStep& step : steps) {
    const Estimate& current = step.dark_current_electrons_per_s;
    if (!(current.value > 2 * current.standard_error)) {
      return Error(absl::StrCat("dark current at ", step.temperature_c, " degrees Celsius is ",
                                current.value, " +- ", current.standard_error,
                                " electrons/s, must be above twice its standard error"));
    }
    kelvin.push_back(step.temperature_c - reference_temperature_c);
    doublings.push_back(std::log2(current.value));
    error.push_back(current.standard_error / (current.value * std::log(2.0)));
  }
  if (const int different = CountDifferent(kelvin); different < 3) {
    return Error(absl::StrCat("doubling temperature from ", different,
                              " temperatures, must be at least 3 different ones"));
  }
  const Line line = FitLine(kelvin, doublings, error);
  DarkCurrentOverTemperature result;
  result.doubling_k.value = 1 / line.slope.value;
  result.doubling_k.standard_error = line.slope.standard_error / Square(line.slope.value);
  result.at_reference_electrons_per_s.value = std::exp2(line.offset.value);
  result.at_reference_electrons_per_s.standard_error =
      result.at_reference_electrons_per_s.value * std::log(2.0) * line.offset.standard_error;
  return result;
}

void FrameStack::Add(const Image<uint16_t>& frame_dn) {
  if (frames_ == 0) {
    sum_.assign(frame_dn.values.size(), 0);
    sum_of_squares_.assign(frame_dn.values.size(), 0);
  }
  assert(frame_dn.values.size() == sum_.size());
  for (size_t i = 0; i < sum_.size(); ++i) {
    const uint64_t value = frame_dn.values[i];
    sum_[i] += value;
    sum_of_squares_[i] += value * value;
  }
  ++frames_;
}

double FrameStack::MeanDn() const {
  double sum = 0;
  for (const uint64_t pixel : sum_) sum += static_cast<double>(pixel);
  return sum / (pixels() * frames_);
}

double FrameStack::TemporalVarianceDn2() const {
  double sum = 0;
  for (size_t i = 0; i < sum_.size(); ++i) {
    const double total = static_cast<double>(sum_[i]);
    sum += (static_cast<double>(sum_of_squares_[i]) - total * total / frames_) / (frames_ - 1);
  }
  return sum / pixels();
}

double FrameStack::MeasuredSpatialVarianceDn2() const {
  const double mean = MeanDn();
  double sum = 0;
  for (const uint64_t pixel : sum_) sum += Square(static_cast<double>(pixel) / frames_ - mean);
  return sum / (pixels() - 1);
}

absl::StatusOr<NonUniformity> MeasureNonUniformity(const FrameStack& dark,
                                                   const FrameStack& half_saturated,
                                                   const Estimate& gain_dn_per_electron) {
  if (dark.frames() < 2 || half_saturated.frames() < 2) {
    return Error(absl::StrCat("stacks have ", dark.frames(), " dark and ", half_saturated.frames(),
                              " bright frames, must have at least 2 each"));
  }
  if (dark.pixels() != half_saturated.pixels()) {
    return Error("dark and bright stacks must have the same pixels");
  }
  const double n = dark.pixels();
  // Temporal noise that is left in the averaged frames, and the pattern itself.
  const double dark_rest = dark.TemporalVarianceDn2() / dark.frames();
  const double bright_rest = half_saturated.TemporalVarianceDn2() / half_saturated.frames();
  const double dark_pattern = dark.MeasuredSpatialVarianceDn2() - dark_rest;
  const double bright_pattern = half_saturated.MeasuredSpatialVarianceDn2() - bright_rest;
  const double response = bright_pattern - dark_pattern;
  const double signal = half_saturated.MeanDn() - dark.MeanDn();
  if (!(signal > 0)) return Error("the bright stack is not brighter than the dark one");

  const auto root = [](double variance, double error) {
    // Near zero, the standard error is the root of the variance's error.
    if (variance <= error) return Estimate{std::sqrt(std::max(variance, 0.0)), std::sqrt(error)};
    return Estimate{std::sqrt(variance), error / (2 * std::sqrt(variance))};
  };
  const double d = std::max(dark_pattern, 0.0), p = std::max(response, 0.0);
  // Chi-squared of n - 1; the rest's own error from n (frames - 1) values.
  const double dark_error = std::sqrt(2 * Square(d + dark_rest) / (n - 1) +
                                      2 * Square(dark_rest) / (n * (dark.frames() - 1)));
  // The dark pattern is the same in both stacks: its own sampling error cancels, its chance
  // correlation with the rest does not.
  const double response_error =
      std::sqrt((2 * Square(p + bright_rest) + 4 * (p + bright_rest) * d + 2 * Square(dark_rest) +
                 4 * dark_rest * d) /
                    (n - 1) +
                2 * Square(bright_rest) / (n * (half_saturated.frames() - 1)));
  NonUniformity result;
  const Estimate dsnu_dn = root(dark_pattern, dark_error);
  const double k = gain_dn_per_electron.value;
  result.dsnu_electrons.value = dsnu_dn.value / k;
  result.dsnu_electrons.standard_error =
      std::hypot(dsnu_dn.standard_error / k,
                 result.dsnu_electrons.value * gain_dn_per_electron.standard_error / k);
  const Estimate prnu_dn = root(response, response_error);
  result.prnu_relative = {prnu_dn.value / signal, prnu_dn.standard_error / signal};
  return result;
}

}  // namespace sightline
