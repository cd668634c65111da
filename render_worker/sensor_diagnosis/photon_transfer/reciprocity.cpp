// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/photon_transfer/reciprocity.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "absl/strings/str_format.h"
#include "core/statistics/normal_distribution.h"
#include "core/statistics/square.h"
#include "render_worker/sensor_diagnosis/departure_names.h"
#include "render_worker/sensor_diagnosis/photon_transfer/material_response.h"

namespace sightline {
namespace {

// Smallest variance of log times, and largest squared correlation of log times with log light, that
// determine the slope. Chosen.
constexpr double kLeastTimeVariance = 1e-3, kLargestCorrelation2 = 0.98;

struct TimedResidual {
  double log_time = 0, log_light = 0;
  double residual = 0;  // of the mean, relative to the expected signal
};

std::vector<TimedResidual> ResidualsOverTime(std::span<const FlatFieldStatistics> steps,
                                             const TransferFit& model) {
  std::vector<TimedResidual> residuals;
  for (const TransferPoint& point : model.points) {
    const FlatFieldStatistics& step = steps[point.step];
    if (step.dark || !step.photons || *step.photons <= 0 || step.exposure_time_s <= 0) continue;
    const double signal_dn = point.expected_mean_dn - model.Value("black_level_dn");
    residuals.push_back({std::log(step.exposure_time_s), std::log(*step.photons),
                         (point.mean_dn - point.expected_mean_dn) / std::max(signal_dn, 1e-9)});
  }
  return residuals;
}

}  // namespace

Departure ReciprocityFailure(std::span<const FlatFieldStatistics> steps, const TransferFit& model) {
  Departure departure{.effect = std::string(kReciprocityFailure), .stage = "time"};
  const std::vector<TimedResidual> residuals = ResidualsOverTime(steps, model);
  double n = 0, x = 0, r = 0, xx = 0, xr = 0, light = 0, x_light = 0, light2 = 0;
  for (const TimedResidual& point : residuals) {
    ++n;
    x += point.log_time;
    r += point.residual;
    xx += point.log_time * point.log_time;
    xr += point.log_time * point.residual;
    light += point.log_light;
    light2 += point.log_light * point.log_light;
    x_light += point.log_time * point.log_light;
  }
  const double variance = n > 2 ? xx / n - Square(x / n) : 0;
  const double light_variance = n > 2 ? light2 / n - Square(light / n) : 0;
  const double covariance = n > 2 ? x_light / n - x * light / n / n : 0;
  if (variance < kLeastTimeVariance ||
      Square(covariance) > kLargestCorrelation2 * variance * light_variance) {
    departure.testable = false;
    departure.description =
        "needs the same number of photons at exposure times that differ ten-fold (weaker light "
        "for longer)";
    return departure;
  }
  const double slope = (xr / n - x * r / n / n) / variance;
  double rest = 0;
  for (const TimedResidual& point : residuals) {
    rest += Square(point.residual - r / n - slope * (point.log_time - x / n));
  }
  const double error = std::sqrt(rest / (n - 2) / (n * variance));
  departure.description = absl::StrFormat(
      "signal of the same light grows with the exposure time to the power of %.3g", slope);
  departure.p_value = NormalTwoSidedTail(slope / error);
  departure.material = std::abs(slope) > kMaterialResponse;
  departure.parameters.push_back({"exponent", "", slope, error});
  return departure;
}

}  // namespace sightline
