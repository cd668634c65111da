// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/photon_transfer/standard_values.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// The step of largest variance saturates if its signal is below this fraction of the largest one.
constexpr double kBelowLargestSignal = 0.999;
// Most pixels are clipped from this fraction of all pixels on.
constexpr double kMostPixels = 0.5;
// Assumed saturation over the largest signal if no step saturates, so that all steps lie below
// nine tenths of it (IsBelowSaturation).
constexpr double kAssumedSaturation = 1.12;

// The series of clause 6.5: pairs with light in the order of the light, each with a dark pair.
std::vector<ExposureStep> ExposureSeries(const FlatFieldSteps& steps) {
  std::vector<ExposureStep> series;
  for (const FlatFieldStatistics* bright : steps.bright) {
    const FlatFieldStatistics* dark = steps.NearestDark(bright->exposure_time_s);
    if (!dark) continue;
    series.push_back({bright->photons.value_or(bright->exposure_time_s), bright->exposure_time_s,
                      bright->pair, dark->pair});
  }
  std::sort(series.begin(), series.end(),
            [](const ExposureStep& a, const ExposureStep& b) { return a.photons < b.photons; });
  series.erase(std::unique(series.begin(), series.end(),
                           [](const ExposureStep& a, const ExposureStep& b) {
                             return a.photons == b.photons;
                           }),
               series.end());
  return series;
}

}  // namespace

Saturation FindSaturation(const FlatFieldSteps& steps) {
  double largest_signal = 0, largest_variance = 0;
  const FlatFieldStatistics* loudest = nullptr;
  for (const FlatFieldStatistics* step : steps.bright) {
    largest_signal = std::max(largest_signal, steps.SignalDn(*step));
    if (step->pair.temporal_variance_dn2 > largest_variance) {
      largest_variance = step->pair.temporal_variance_dn2;
      loudest = step;
    }
  }
  Saturation saturation;
  saturation.reached = loudest && steps.SignalDn(*loudest) < kBelowLargestSignal * largest_signal;
  for (const FlatFieldStatistics* step : steps.bright) {
    saturation.reached |= step->share_at_largest > kMostPixels;
  }
  saturation.signal_dn = saturation.reached && loudest ? steps.SignalDn(*loudest)
                                                       : kAssumedSaturation * largest_signal;
  return saturation;
}

StandardValues MeasureByStandard(const FlatFieldSteps& steps) {
  StandardValues values;
  auto transfer = MeasurePhotonTransfer(ExposureSeries(steps));
  if (!transfer.ok()) {
    values.warning =
        absl::StrCat("no values by the definitions of EMVA 1288: ", transfer.status().message());
    return values;
  }
  values.transfer = *std::move(transfer);
  std::vector<DarkStep> dark_steps;
  for (const FlatFieldStatistics* step : steps.dark) {
    dark_steps.push_back({step->exposure_time_s, step->pair});
  }
  auto dark = MeasureDarkCurrent(dark_steps, values.transfer->gain_dn_per_electron);
  if (dark.ok()) values.dark_current = *std::move(dark);
  return values;
}

}  // namespace sightline
