// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/screening/fringe_search.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <map>
#include <numbers>
#include <tuple>

#include "render_worker/diagnosis/selection/thresholds.h"
#include "render_worker/diagnosis/statistic/pattern/relative_residuals.h"
#include "render_worker/frame/ideal_image.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

using std::numbers::pi;

// Sums over the recordings of a region: relative residuals times information, and information.
struct SensorMap {
  RegionOfInterest roi;
  Image<double> value;
  double information = 0;
};

// The first frame of each plate position, by region; the region of most positions first.
std::vector<std::vector<const RecordedFrame*>> FramesOfRegions(const RecordedSet& set) {
  std::map<std::tuple<int, int, int, int>, std::map<int, const RecordedFrame*>> positions;
  for (const RecordedFrame& frame : set.frames) {
    if (frame.plate_position_id < 0 || frame.raw_dn.empty()) continue;
    const RegionOfInterest& roi = frame.nominal.roi;
    positions[{roi.row_px, roi.column_px, roi.rows_px, roi.columns_px}].emplace(
        frame.plate_position_id, &frame);
  }
  std::vector<std::vector<const RecordedFrame*>> regions;
  for (const auto& [region, frame_of] : positions) {
    std::vector<const RecordedFrame*>& frames = regions.emplace_back();
    for (const auto& [id, frame] : frame_of) frames.push_back(frame);
  }
  std::stable_sort(regions.begin(), regions.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return regions;
}

SensorMap MapOf(const std::vector<const RecordedFrame*>& frames) {
  SensorMap map;
  map.roi = frames.front()->nominal.roi;
  map.value = Image<double>(map.roi.columns_px, map.roi.rows_px, 0.0);
  for (const RecordedFrame* frame : frames) {
    const Sensor& sensor = frame->nominal.sensor;
    const RelativeResiduals residuals =
        MakeRelativeResiduals(frame->raw_dn, DarkMeanDn(sensor), sensor.largest_dn(), 1);
    for (size_t i = 0; i < map.value.values.size(); ++i) {
      map.value.values[i] += residuals.value.values[i];
    }
    for (double weight : residuals.weights) map.information += weight * map.roi.columns_px / 2;
  }
  return map;
}

bool IsDark(const double* values, int columns_px) {
  return std::all_of(values, values + columns_px, [](double x) { return x == 0; });
}

std::complex<double> Wave(double turns) { return std::polar(1.0, 2 * pi * turns); }

// Phase [turns] at the principal point that the effect gives the camera of `frame` by its seed.
double CameraPhase(ActiveEffect fringes, const FrameSetup& frame) {
  const auto cosine = [&](double phase_deg) {
    // Amplitude 1/2 so that no rounding clips it; long fringes, which a pixel does not average.
    fringes.parameters = {0.5, 2000, 0, phase_deg};
    PixelIrradiance light;
    light.roi = {0, 0, 1, 1};
    light.laser_irradiance_w_m2 = Image<float>(1, 1, 1.0F);
    fringes.effect->OnPixelIrradiance(light, frame, fringes.parameters);
    return (light.laser_irradiance_w_m2.At(0, 0) - 1) / 0.5;
  };
  return std::atan2(-cosine(90), cosine(0)) / (2 * pi);
}

// A wave: turns per pixel along a row and from row to row, and its amplitude.
struct FringePeak {
  double along_u = 0, along_v = 0;
  std::complex<double> amplitude = 0;  // with the phase at the principal point
};

// Adds the amplitudes at frequencies (along_u, first_v + i step_v).
void AddAmplitudes(const SensorMap& map, double along_u, double first_v, double step_v,
                   std::vector<std::complex<double>>& amplitudes) {
  for (int row = 0; row < map.roi.rows_px; ++row) {
    const double* values = map.value.Row(row);
    if (IsDark(values, map.roi.columns_px)) continue;
    const int v = map.roi.row_px + row;
    const std::complex<double> next = Wave(-along_u);
    std::complex<double> wave = Wave(-(along_u * map.roi.column_px + first_v * v)), sum = 0;
    for (int c = 0; c < map.roi.columns_px; ++c, wave *= next) sum += values[c] * wave;
    const std::complex<double> turn = Wave(-step_v * v);
    for (std::complex<double>& amplitude : amplitudes) {
      amplitude += sum;
      sum *= turn;
    }
  }
}

// The strongest wave near a peak of one region, by all regions: those far apart distinguish
// frequencies that each of them alone cannot.
FringePeak RefinedFringes(const std::vector<SensorMap>& maps, const FringePeak& about,
                          double step_u, double step_v) {
  FringePeak best;
  std::vector<std::complex<double>> amplitudes(2 * thresholds::kWidthOfPeak * thresholds::kFiner +
                                               1);
  for (int i = -thresholds::kFiner; i <= thresholds::kFiner; ++i) {
    const double along_u = about.along_u + i * step_u / thresholds::kFiner;
    const double first_v = about.along_v - thresholds::kWidthOfPeak * step_v;
    std::fill(amplitudes.begin(), amplitudes.end(), 0.0);
    for (const SensorMap& map : maps) {
      AddAmplitudes(map, along_u, first_v, step_v / thresholds::kFiner, amplitudes);
    }
    for (size_t j = 0; j < amplitudes.size(); ++j) {
      if (std::norm(amplitudes[j]) <= std::norm(best.amplitude)) continue;
      best = {along_u, first_v + static_cast<double>(j) * step_v / thresholds::kFiner,
              amplitudes[j]};
    }
  }
  return best;
}

}  // namespace

std::vector<ActiveEffect> FringesSeen(const Effect& effect, const RecordedSet& set) {
  const std::vector<std::vector<const RecordedFrame*>> regions = FramesOfRegions(set);
  std::vector<SensorMap> maps;
  double information = 0;
  for (const auto& frames : regions) {
    maps.push_back(MapOf(frames));
    information += maps.back().information;
  }
  if (maps.empty() || maps.front().information <= 0) return {};
  const double step_u = 1.0 / (thresholds::kOversampling * maps.front().roi.columns_px);
  constexpr double kStepV = 1.0 / thresholds::kFrequenciesAcross;
  // Up to half a turn a pixel. A wave of less than one turn along the region is unevenness of the
  // light.
  const int first = thresholds::kOversampling,
            along = maps.front().roi.columns_px * thresholds::kOversampling / 2;
  Image<double> power(along, thresholds::kFrequenciesAcross, 0.0);
  std::vector<std::complex<double>> amplitudes(thresholds::kFrequenciesAcross);
  for (int k = first; k < along; ++k) {
    std::fill(amplitudes.begin(), amplitudes.end(), 0.0);
    AddAmplitudes(maps.front(), k * step_u, -0.5, kStepV, amplitudes);
    for (int m = 0; m < thresholds::kFrequenciesAcross; ++m) {
      power.At(m, k) = std::norm(amplitudes[m]);
    }
  }

  ActiveEffect fringes{&effect, {0, 0, 0, 0}};
  const std::vector<EffectParameter>& bounds = fringes.effect->description().parameters;
  const double camera_turns = CameraPhase(fringes, regions.front().front()->nominal);
  std::vector<ActiveEffect> seen;
  for (int i = 0; i < thresholds::kFringePeaks; ++i) {
    const auto largest = std::max_element(power.values.begin(), power.values.end());
    if (*largest <= 0) break;
    const auto at = static_cast<int>(largest - power.values.begin());
    const int k = at % along, m = at / along;
    const FringePeak peak = RefinedFringes(maps, {k * step_u, m * kStepV - 0.5}, step_u, kStepV);
    for (int row = std::max(0, m - thresholds::kWidthOfPeak);
         row <= std::min(thresholds::kFrequenciesAcross - 1, m + thresholds::kWidthOfPeak); ++row) {
      for (int c = std::max(0, k - thresholds::kWidthOfPeak);
           c <= std::min(along - 1, k + thresholds::kWidthOfPeak); ++c) {
        power.At(row, c) = 0;
      }
    }
    const double turns = std::arg(peak.amplitude) / (2 * pi) - camera_turns;
    fringes.parameters = {
        2 * std::abs(peak.amplitude) / information, 1 / std::hypot(peak.along_u, peak.along_v),
        std::atan2(peak.along_v, peak.along_u) * 180 / pi, 360 * (turns - std::round(turns))};
    for (size_t p = 0; p < bounds.size(); ++p) {
      fringes.parameters[p] = std::clamp(fringes.parameters[p], bounds[p].lower, bounds[p].upper);
    }
    seen.push_back(fringes);
  }
  return seen;
}

}  // namespace sightline
