// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/mean_numbers.h"

#include <algorithm>
#include <array>
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <numbers>
#include <numeric>
#include <set>

#include "core/statistics/normal_distribution.h"
#include "render_worker/diagnosis/expectation/rounded_normal.h"

namespace sightline {

namespace {

constexpr double kLinear = 0.03;  // of the noise: numbers that differ by less do so linearly

// The converter's output for every number; empty if it changes none.
std::vector<uint16_t> ConvertedNumbers(const FrameSetup& frame,
                                       std::span<const ActiveEffect> effects) {
  Image<uint16_t> ramp(static_cast<int>(frame.sensor.largest_dn()) + 1, 1);
  std::iota(ramp.values.begin(), ramp.values.end(), uint16_t{0});
  const std::vector<uint16_t> numbers = ramp.values;
  for (const ActiveEffect& active : effects) {
    active.effect->OnRaw(ramp, frame, active.parameters);
  }
  if (ramp.values == numbers) return {};
  return ramp.values;
}

// The step s > 1 if every number n becomes s floor(n/s); else 1.
int StepOf(const std::vector<uint16_t>& converted) {
  size_t step = 1;
  while (step < converted.size() && converted[step] == 0) ++step;
  for (size_t n = 0; n < converted.size(); ++n) {
    if (converted[n] != n / step * step) return 1;
  }
  return static_cast<int>(step);
}

// The numbers that full pixels give. A full pixel has no noise: its charge is cut off together with
// the noise, at the number that a full pixel gives or at the largest.
Image<double> NumbersOfFullPixels(const FrameSetup& frame, std::span<const ActiveEffect> effects) {
  const Sensor& sensor = frame.sensor;
  Image<double> full(frame.roi.columns_px, frame.roi.rows_px, sensor.saturation_capacity_electrons);
  for (const ActiveEffect& active : effects) {
    active.effect->OnElectrons(full, frame, active.parameters);
  }
  for (double& value : full.values) {
    value =
        std::clamp(std::floor(sensor.gain_dn_per_electron * value + sensor.black_level_dn + 0.5),
                   0.0, sensor.largest_dn());
  }
  return full;
}

}  // namespace

MeanNumbers::MeanNumbers(const FrameSetup& frame, std::span<const ActiveEffect> effects)
    : gain_dn_per_electron_(frame.sensor.gain_dn_per_electron),
      black_level_dn_(frame.sensor.black_level_dn),
      plateau_dn_(NumbersOfFullPixels(frame, effects)),
      converted_(ConvertedNumbers(frame, effects)) {
  if (!converted_.empty()) step_dn_ = StepOf(converted_);
  const double step_dn =
      converted_.empty()
          ? 1
          : static_cast<double>(converted_.size()) /
                static_cast<double>(std::set(converted_.begin(), converted_.end()).size());
  rounding_variance_dn2_ = step_dn * step_dn / 12;
}

// Mean of min(max(X, 0), top) for X normal, whose variance grows by the gain with its mean (shot
// noise).
MeanNumbers::CutOff MeanNumbers::MeanCutOff(double mean, double deviation, double top) const {
  const double low = -mean / deviation, high = (top - mean) / deviation;
  if (low < -6 && high > 6) return {mean, 1};
  if (high < -6) return {top, 0};
  if (low > 6) return {0, 0};
  const double growth = gain_dn_per_electron_ / (2 * deviation);  // of the deviation with the mean
  // Mostly one end is far away.
  if (high > 6) {
    const double above = NormalDistribution(-low), density = NormalDensity(low);
    return {mean * above + deviation * density, above + growth * density};
  }
  if (low < -6) {
    const double below = NormalDistribution(high), density = NormalDensity(high);
    return {mean * below - deviation * density + top * (1 - below), below - growth * density};
  }
  const double inside = NormalDistribution(high) - NormalDistribution(low);
  const double densities = NormalDensity(low) - NormalDensity(high);
  return {mean * inside + deviation * densities + top * (1 - NormalDistribution(high)),
          inside + growth * densities};
}

// Mean change by the converter of a normal number of this mean and deviation, rounded: at equally
// likely values of it.
float MeanNumbers::MeanConversion(float mean, float deviation) const {
  constexpr int kValues = 64;
  static const std::array<float, kValues> normal = [] {
    std::array<float, kValues> quantiles;
    for (int i = 0; i < kValues; ++i) {
      quantiles[i] =
          static_cast<float>(-std::numbers::sqrt2 * boost::math::erfc_inv(2 * (i + 0.5) / kValues));
    }
    return quantiles;
  }();
  float sum = 0;
  for (const float z : normal) {
    const auto number = static_cast<int>(std::clamp<float>(
        mean + deviation * z + 0.5F, 0.0F, static_cast<float>(converted_.size() - 1)));
    sum += static_cast<float>(converted_[number]) - static_cast<float>(number);
  }
  return sum / kValues;
}

// Rounding moves the mean only where noise does not spread it over several numbers.
void MeanNumbers::AddRoundingErrors(const Image<double>& electrons, const Image<float>& noise_dn,
                                    const Image<double>& spread_dn2, Image<float>* numbers) const {
  for (size_t i = 0; i < numbers->values.size(); ++i) {
    const double noise = noise_dn.values[i];
    const double variance = noise * noise - rounding_variance_dn2_;
    if (variance <= 0 || !IsCoarselyRounded(std::sqrt(variance + spread_dn2.values[i]), step_dn_)) {
      continue;
    }
    const double mean = gain_dn_per_electron_ * electrons.values[i] + black_level_dn_;
    if (mean > plateau_dn_.values[i] - step_dn_) continue;
    const double number = MomentsAfterRounding(mean, std::sqrt(variance), step_dn_).mean;
    // The number replaces a cut-off normal one, whose cut at zero the rounded one has, too.
    numbers->values[i] = static_cast<float>(number);
  }
}

Image<float> MeanNumbers::Of(const Image<double>& electrons, const Image<float>& noise_dn,
                             const Image<double>& spread_dn2) {
  Image<float> numbers(electrons.columns_px, electrons.rows_px);
  const bool first = reference_.empty();
  if (first) reference_.resize(numbers.values.size());
  for (size_t i = 0; i < numbers.values.size(); ++i) {
    const double mean = gain_dn_per_electron_ * electrons.values[i] + black_level_dn_;
    const float noise = noise_dn.values[i];
    Reference& reference = reference_[i];
    if (first || std::abs(mean - reference.number) > kLinear * noise) {
      const CutOff cut_off = MeanCutOff(mean, noise, plateau_dn_.values[i]);
      if (first) reference = {mean, cut_off};
      numbers.values[i] = static_cast<float>(cut_off.mean);
    } else {
      numbers.values[i] = static_cast<float>(reference.cut_off.mean +
                                             reference.cut_off.slope * (mean - reference.number));
    }
  }
  if (step_dn_ == 1) AddRoundingErrors(electrons, noise_dn, spread_dn2, &numbers);
  if (converted_.empty()) return numbers;
  for (size_t i = 0; i < numbers.values.size(); ++i) {
    numbers.values[i] += MeanConversion(numbers.values[i], noise_dn.values[i]);
  }
  // Rounding to multiples of the step replaces the conversion.
  if (step_dn_ > 1) AddRoundingErrors(electrons, noise_dn, spread_dn2, &numbers);
  return numbers;
}

}  // namespace sightline
