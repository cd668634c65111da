// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/frames/frame_memory.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "absl/strings/str_format.h"
#include "core/statistics/normal_distribution.h"
#include "render_worker/sensor_diagnosis/departure_names.h"
#include "render_worker/sensor_diagnosis/frames/temporal_variance.h"

namespace sightline {
namespace {

// Fewest frames with two pairs that are two apart, and fewest steps whose differences determine
// their standard error to about a quarter. Chosen.
constexpr int kFewestFramesForCorrelation = 4, kFewestStepsForDeficit = 10;
// Smallest correlation and smallest relative difference that matter. Chosen.
constexpr double kMaterialCarriedOver = 2e-3, kMaterialDeficit = 1e-3;

}  // namespace

Departure FrameCorrelation(std::span<const FlatFieldStatistics* const> steps) {
  Departure departure{.effect = std::string(kFrameCorrelation), .stage = "readout"};
  WeightedMean carried;
  for (const FlatFieldStatistics* step : steps) {
    if (step->frames() < kFewestFramesForCorrelation) continue;
    const Estimate& near = *step->noise.variance_1_apart_dn2;
    const Estimate& far = *step->noise.variance_2_apart_dn2;
    if (far.value <= 0) continue;
    // If a frame consists of (1 - l) of its own signal and l of the one before, consecutive frames
    // are correlated by about l, and frames two apart are not.
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
  departure.p_value = NormalUpperTail(value / carried.Error());
  departure.material = value > kMaterialCarriedOver;
  departure.parameters.push_back({"correlation", "", value, carried.Error()});
  return departure;
}

Departure FirstFrameDeficit(std::span<const FlatFieldStatistics* const> steps) {
  Departure departure{.effect = std::string(kFirstFrameDeficit), .stage = "time"};
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
  departure.p_value = NormalTwoSidedTail(mean / error);
  departure.material = std::abs(mean) > kMaterialDeficit;
  departure.parameters.push_back({"difference", "", mean, error});
  return departure;
}

}  // namespace sightline
