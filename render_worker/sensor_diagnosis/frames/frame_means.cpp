// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/frames/frame_means.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "core/statistics/normal_distribution.h"
#include "render_worker/sensor_diagnosis/departure_names.h"
#include "render_worker/sensor_diagnosis/frames/temporal_variance.h"

namespace sightline {
namespace {

// Fewer frames do not determine a slope in addition to their noise. Chosen.
constexpr int kFewestFramesForDrift = 8;
// Smallest changes that matter: of the light, relative, a tenth of the photon noise of a full pixel
// of 10 000 electrons; of the black level, a fraction of the quantisation step [DN]. Chosen.
constexpr double kMaterialLight = 1e-3, kMaterialBlackLevel_dn = 0.1;

// The level under test, with the texts of its descriptions.
struct FrameLevel {
  std::string_view noise_name, drift_name;
  const char *noise_stage, *level, *condition;
  const char *unit, *shown_unit;
  bool relative;  // changes are relative to the mean
  double material;
};

constexpr FrameLevel kLight = {.noise_name = kLightFlicker,
                               .drift_name = kLightDrift,
                               .noise_stage = "illumination",
                               .level = "light",
                               .condition = "with light",
                               .unit = "",
                               .shown_unit = "(relative)",
                               .relative = true,
                               .material = kMaterialLight};
constexpr FrameLevel kBlackLevel = {.noise_name = kBlackLevelNoise,
                                    .drift_name = kBlackLevelDrift,
                                    .noise_stage = "readout",
                                    .level = "black level",
                                    .condition = "in the dark",
                                    .unit = "DN",
                                    .shown_unit = "DN",
                                    .relative = false,
                                    .material = kMaterialBlackLevel_dn};

// Sums over steps of the squared deviations of frame means from the mean of their step.
struct FrameMeanSums {
  double chi_squared = 0, freedom = 0;
  double excess = 0;  // without temporal noise; relative to the squared mean, or [DN^2]
};

FrameMeanSums SumOverSteps(std::span<const FlatFieldStatistics* const> steps, bool relative) {
  FrameMeanSums sums;
  for (const FlatFieldStatistics* step : steps) {
    const double mean = step->MeanDn();
    const double noise = std::max(VarianceOfFrameMean(*step), 1e-12);
    double square = 0;
    for (const double value : step->frame_mean_dn) square += Square(value - mean);
    sums.chi_squared += square / noise;
    sums.freedom += step->frames() - 1;
    sums.excess +=
        std::max(0.0, square - (step->frames() - 1) * noise) / (relative ? Square(mean) : 1);
  }
  return sums;
}

// Chi squared of frame means, with temporal noise as their only error.
Departure NoiseOfLevel(const FrameMeanSums& sums, const FrameLevel& level) {
  const double deviation = std::sqrt(sums.excess / sums.freedom);
  Departure departure{.effect = std::string(level.noise_name),
                      .stage = level.noise_stage,
                      .description = absl::StrFormat(
                          "the %s changes from frame to frame by %.3g %s (standard deviation)",
                          level.level, deviation, level.shown_unit),
                      .p_value = ChiSquaredTailP(sums.chi_squared, sums.freedom),
                      .material = deviation > level.material};
  departure.parameters.push_back(
      {"standard_deviation", level.unit, deviation, deviation / std::sqrt(2 * sums.freedom)});
  return departure;
}

// Slope of the frame means over the longest series; its error from the scatter about the line.
Departure DriftOfLevel(const FlatFieldStatistics& longest, const FrameLevel& level) {
  Departure drift{.effect = std::string(level.drift_name), .stage = "time"};
  if (longest.frames() < kFewestFramesForDrift) {
    drift.testable = false;
    drift.description =
        absl::StrFormat("a drift shows in at least %d frames %s under the same conditions",
                        kFewestFramesForDrift, level.condition);
    return drift;
  }
  const double n = longest.frames(), mean = longest.MeanDn();
  double xx = 0, xy = 0, rest = 0;
  for (int i = 0; i < longest.frames(); ++i) {
    const double x = i / (n - 1) - 0.5;
    xx += x * x;
    xy += x * (longest.frame_mean_dn[i] - mean);
  }
  const double slope = xy / xx;
  for (int i = 0; i < longest.frames(); ++i) {
    rest += Square(longest.frame_mean_dn[i] - mean - slope * (i / (n - 1) - 0.5));
  }
  const double error = std::sqrt(std::max(rest / (n - 2), VarianceOfFrameMean(longest)) / xx);
  const double scale = level.relative ? mean : 1;
  drift.description = absl::StrFormat("the %s drifts by %.3g %s over %.0f frames", level.level,
                                      slope / scale, level.shown_unit, n);
  drift.p_value = NormalTwoSidedTail(slope / error);
  drift.material = std::abs(slope / scale) > level.material;
  drift.parameters.push_back({"drift_over_series", level.unit, slope / scale, error / scale});
  return drift;
}

std::vector<Departure> ChangesOfLevel(std::span<const FlatFieldStatistics* const> steps,
                                      const FrameLevel& level) {
  const FrameMeanSums sums = SumOverSteps(steps, level.relative);
  if (sums.freedom == 0) return {};
  const FlatFieldStatistics* longest = steps.front();
  for (const FlatFieldStatistics* step : steps) {
    if (step->frames() > longest->frames()) longest = step;
  }
  return {NoiseOfLevel(sums, level), DriftOfLevel(*longest, level)};
}

}  // namespace

double DeviationOfFrameMeans(std::span<const FlatFieldStatistics* const> steps) {
  double squares = 0, freedom = 0;
  for (const FlatFieldStatistics* step : steps) {
    const double mean = step->MeanDn();
    double square = 0;
    for (const double value : step->frame_mean_dn) square += Square(value - mean);
    squares += square - (step->frames() - 1) * VarianceOfFrameMean(*step);
    freedom += step->frames() - 1;
  }
  return freedom > 0 ? std::sqrt(std::max(0.0, squares / freedom)) : 0;
}

std::vector<Departure> LightChanges(std::span<const FlatFieldStatistics* const> bright) {
  return ChangesOfLevel(bright, kLight);
}

std::vector<Departure> BlackLevelChanges(std::span<const FlatFieldStatistics* const> dark) {
  return ChangesOfLevel(dark, kBlackLevel);
}

}  // namespace sightline
