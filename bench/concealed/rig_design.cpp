// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/rig_design.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/str_format.h"
#include "core/random/counter_random.h"
#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "render_worker/recordings/plate_frames.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline::bench {
namespace {

// Rounded to this many significant digits, as people write nominal values down.
double Rounded(double value, int digits) {
  if (value == 0) return 0;
  const double scale = std::pow(10, digits - 1 - std::floor(std::log10(std::abs(value))));
  return std::round(value * scale) / scale;
}

class Draw {
 public:
  Draw(uint64_t seed, const char* purpose) : random_(DeriveSeed(seed, purpose), 0) {}
  double Between(double low, double high) { return low + (high - low) * random_.Uniform(); }
  double LogBetween(double low, double high) {
    return std::exp(Between(std::log(low), std::log(high)));
  }
  int Below(int count) { return std::min(count - 1, static_cast<int>(count * random_.Uniform())); }
  template <typename T>
  const T& OneOf(const std::vector<T>& values) {
    return values[Below(static_cast<int>(values.size()))];
  }
  template <typename T>
  void Shuffle(std::vector<T>& values) {
    for (int i = static_cast<int>(values.size()) - 1; i > 0; --i) {
      std::swap(values[i], values[Below(i + 1)]);
    }
  }

 private:
  CounterRandom random_;
};

Sensor DrawCamera(Draw& draw, double wavelength_m) {
  Sensor sensor;
  const auto efficiency = [&](double value) {
    return QuantumEfficiencyCurve{{wavelength_m}, {Rounded(value * draw.Between(0.85, 1.15), 2)}};
  };
  switch (draw.Below(4)) {
    case 0:  // mono, 10 bit
      sensor.pixel_pitch_m = 5.3e-6;
      sensor.columns_px = 1280;
      sensor.rows_px = 1024;
      sensor.bit_depth_bit = 10;
      sensor.gain_dn_per_electron = 0.16;
      sensor.dark_mean_electrons = 27.6;
      sensor.dark_noise_electrons = 6.5;
      sensor.quantum_efficiency[0] = efficiency(0.53);
      break;
    case 1:  // mono, 12 bit, low noise
      sensor.pixel_pitch_m = 3.45e-6;
      sensor.columns_px = 2448;
      sensor.rows_px = 2048;
      sensor.bit_depth_bit = 12;
      sensor.gain_dn_per_electron = 0.42;
      sensor.dark_mean_electrons = 22;
      sensor.dark_noise_electrons = 2.3;
      sensor.quantum_efficiency[0] = efficiency(0.45);
      break;
    case 2:  // colour, 10 bit
      sensor.colour_filter = ColourFilter::kBayerRggb;
      sensor.pixel_pitch_m = 5.86e-6;
      sensor.columns_px = 1936;
      sensor.rows_px = 1216;
      sensor.bit_depth_bit = 10;
      sensor.gain_dn_per_electron = 0.53;
      sensor.dark_mean_electrons = 15;
      sensor.dark_noise_electrons = 3.5;
      sensor.quantum_efficiency = {efficiency(0.48), efficiency(0.09), efficiency(0.03)};
      break;
    default:  // colour, 12 bit
      sensor.colour_filter = ColourFilter::kBayerRggb;
      sensor.pixel_pitch_m = 4.8e-6;
      sensor.columns_px = 1600;
      sensor.rows_px = 1200;
      sensor.bit_depth_bit = 12;
      sensor.gain_dn_per_electron = 0.35;
      sensor.dark_mean_electrons = 18;
      sensor.dark_noise_electrons = 4.5;
      sensor.quantum_efficiency = {efficiency(0.42), efficiency(0.12), efficiency(0.05)};
      break;
  }
  sensor.gain_dn_per_electron = Rounded(sensor.gain_dn_per_electron * draw.Between(0.9, 1.1), 3);
  sensor.dark_mean_electrons = Rounded(sensor.dark_mean_electrons * draw.Between(0.8, 1.3), 3);
  sensor.dark_noise_electrons = Rounded(sensor.dark_noise_electrons * draw.Between(0.85, 1.2), 2);
  // The converter is full before the pixel is.
  sensor.saturation_capacity_electrons =
      Rounded(draw.Between(1.2, 1.6) * sensor.largest_dn() / sensor.gain_dn_per_electron, 4);
  return sensor;
}

SetupDeviation DrawUncertainty(Draw& draw) {
  SetupDeviation u;
  const auto about = [&](double value) {
    return Rounded(value * draw.OneOf<double>({0.7, 1, 1, 1.4}), 2);
  };
  u.camera_distance_m = about(2e-3);
  u.focus_distance_relative = about(0.015);
  u.f_number_relative = about(0.015);
  u.laser_distance_m = about(3e-3);
  u.beam_focus_distance_m = about(0.01);
  u.incidence_angle_rad = about(0.3) * std::numbers::pi / 180;
  u.divergence_relative = about(0.02);
  u.power_relative = about(0.02);
  u.transmission_relative = about(0.02);
  u.diffuse_albedo_relative = about(0.08);
  u.specular_f0_relative = about(0.05);
  u.ggx_alpha_relative = about(0.03);
  u.quantum_efficiency_relative = about(0.02);
  u.gain_relative = about(0.01);
  u.dark_mean_electrons = about(0.3);
  u.dark_noise_relative = about(0.03);
  u.line_position_common_px = about(1.5);
  u.line_position_each_px = about(0.3);
  return u;
}

// A recording to be taken; `exposure` is a share of the exposure that fits, or seconds if dark.
struct Shot {
  const char* series;
  double exposure = 1;
  double f_number = 8;
  double camera_distance_m = 0;
  double focus_distance_m = 0;
  double laser_distance_m = 0;
  int field_column = 0, field_row = 0;  // -1, 0, 1: left, middle, right; upper, middle, lower
  bool dark = false;
};
using Burst = std::vector<Shot>;

// Exposure shares of a sweep in random order, then shortest and longest again (the longest before
// what follows shows image lag), then a dark frame.
Burst Sweep(Draw& draw, const Shot& base, int steps) {
  const double least = draw.Between(0.08, 0.13), most = draw.Between(6, 10);
  std::vector<double> shares;
  for (int i = 0; i < steps; ++i) {
    shares.push_back(least * std::pow(most / least, i / (steps - 1.0)));
  }
  const double shortest = shares.front(), longest = shares.back();
  draw.Shuffle(shares);
  if (shares.back() == shortest) std::swap(shares.front(), shares.back());
  shares.push_back(shortest);
  if (steps > 3) shares.push_back(longest);
  Burst burst;
  for (const double share : shares) {
    Shot shot = base;
    shot.exposure = share;
    burst.push_back(shot);
  }
  Shot dark = base;
  dark.dark = true;
  dark.exposure = 2e-4;
  if (steps > 3) burst.push_back(dark);
  return burst;
}

std::vector<Burst> DrawShots(Draw& draw, SetSize size, double camera_m, double laser_m) {
  Shot base{.series = ""};
  base.camera_distance_m = base.focus_distance_m = camera_m;
  base.laser_distance_m = laser_m;
  std::vector<Burst> bursts;
  const auto add = [&](const char* series, double f_number) -> Shot& {
    Shot shot = base;
    shot.series = series;
    shot.f_number = f_number;
    bursts.push_back({shot});
    return bursts.back().front();
  };
  const auto near = [&](double value) { return Rounded(value * draw.Between(0.95, 1.05), 2); };
  Shot sweep = base;
  sweep.series = "exposure_sweep";
  Shot noise = base;
  noise.series = "noise";
  noise.f_number = 5.6;
  if (size == SetSize::kSmall) {
    sweep.f_number = 5.6;
    bursts.push_back(Sweep(draw, sweep, 3));
    bursts.push_back({noise, noise});
    add("aperture", 2.8);
    add("aperture", 11);
    add("distance", 4).camera_distance_m = near(0.45);
    add("laser_distance", 8).laser_distance_m = near(0.5);
    add("field", 4).field_column = draw.Below(2) == 0 ? -1 : 1;
    for (const double exposure : {0.002, 0.3}) {
      Shot& dark = add("dark", 8);
      dark.dark = true;
      dark.exposure = exposure;
    }
    return bursts;
  }
  sweep.f_number = draw.OneOf<double>({5.6, 8, 11});
  bursts.push_back(Sweep(draw, sweep, 5 + draw.Below(3)));
  bursts.emplace_back(3 + draw.Below(2), noise);
  for (const double f_number : {1.4, 2., 2.8, 4., 5.6, 11., 16., 22.}) add("aperture", f_number);
  for (const double distance : {0.2, 0.25, 0.3, 0.4, 0.45, 0.5}) {
    add("distance", 4).camera_distance_m = near(distance);
  }
  for (const double distance : {0.25, 0.5}) add("distance", 2).camera_distance_m = near(distance);
  for (const double distance : {0.28, 0.52}) {
    add("laser_distance", 8).laser_distance_m = near(distance);
  }
  for (const double distance : {0.25, 0.48}) add("focus", 2.8).focus_distance_m = near(distance);
  add("focus", 1.4).focus_distance_m = near(0.3);
  add("field", 2.8).field_column = -1;
  add("field", 2.8).field_column = 1;
  const int corner = draw.Below(2) == 0 ? -1 : 1;
  for (const int side : {-1, 1}) {
    Shot& shot = add("field", 5.6);
    shot.field_column = side;
    shot.field_row = side * corner;
  }
  for (int i = 0; i < 3; ++i) add("shifted_plate", 8);
  for (const double exposure : {0.5, 0.1, 0.02, 0.002}) {
    Shot& dark = add("dark", 8);
    dark.dark = true;
    dark.exposure = exposure;
  }
  return bursts;
}

// Mean photo-electrons a second at the crest of the line, of the most sensitive colour.
double CrestElectronsPerSecond(const RecordingSet& set, int index) {
  FrameSetup frame = PlateFrame(set, index, {});
  frame.roi.column_px += frame.roi.columns_px / 2;
  frame.roi.columns_px = 2;
  frame.exposure_time_s = 1;
  const ExpectedFrame expected = ExpectFrame(frame, {}, nullptr, nullptr, 2);
  const std::vector<double>& values = expected.mean_photo_electrons.values;
  return *std::max_element(values.begin(), values.end());
}

}  // namespace

RecordingSet DrawRig(uint64_t seed, const std::string& name, SetSize size) {
  Draw draw(seed, "rig");
  RecordingSet set;
  set.format_version = 1;
  set.name = name;
  set.laser.wavelength_m = 661e-9;
  set.laser.power_w = Rounded(draw.Between(4e-4, 7e-4), 2);
  set.laser.divergence_rad = Rounded(draw.Between(8e-4, 1.2e-3), 3);
  set.laser.beam_focus_distance_m = Rounded(draw.Between(0.36, 0.46), 3);
  set.laser.fan_angle_rad = Rounded(draw.Between(31, 44), 3) * std::numbers::pi / 180;
  set.camera = DrawCamera(draw, set.laser.wavelength_m);
  set.focal_length_m = draw.OneOf<double>({0.012, 0.016, 0.016});
  set.transmission = Rounded(draw.Between(0.85, 0.94), 2);
  set.surface.diffuse_albedo = Rounded(draw.Between(0.25, 0.45), 2);
  set.surface.specular_f0 = Rounded(draw.Between(0.5, 0.68), 2);
  set.surface.ggx_alpha = Rounded(draw.Between(0.27, 0.45), 2);
  set.incidence_angle_rad = draw.OneOf<double>({35, 40, 45, 45, 50}) * std::numbers::pi / 180;
  set.uncertainty = DrawUncertainty(draw);

  const double camera_m = Rounded(draw.Between(0.31, 0.37), 3);
  const double laser_m = Rounded(draw.Between(0.36, 0.44), 3);
  std::vector<Burst> bursts = DrawShots(draw, size, camera_m, laser_m);
  draw.Shuffle(bursts);

  const int columns = size == SetSize::kSmall ? 192 : 384;
  const int rows = size == SetSize::kSmall ? 160 : 256;
  const double crest_share = draw.Between(0.2, 0.35);
  const double full_electrons = set.camera.largest_dn() / set.camera.gain_dn_per_electron;
  using Setup = std::tuple<bool, double, double, double, double, double, int, int>;
  std::map<Setup, int> repeat_groups;
  double time_s = 0;
  int position = 0;
  for (const Burst& burst : bursts) {
    time_s = std::round((time_s + draw.Between(20, 70)) * 1e3) / 1e3;
    bool lit_before = false;
    // People round exposures generously; repeats are equal.
    const double jitter = draw.LogBetween(0.8, 1.25);
    const bool repeated = std::string(burst.front().series) == "shifted_plate";
    if (!burst.front().dark) ++position;
    for (size_t k = 0; k < burst.size(); ++k) {
      const Shot& shot = burst[k];
      RecordedImage image;
      image.file = absl::StrFormat("images/%03d.png", set.recordings.size());
      image.kind = shot.dark ? RecordingKind::kDark : RecordingKind::kLaser;
      image.timestamp_s = std::round((time_s + 0.2 * static_cast<double>(k)) * 1e3) / 1e3;
      image.series = shot.series;
      image.burst_frame_index = static_cast<int>(k);
      if (!shot.dark) {
        image.plate_position_id = position;
        image.same_speckle = lit_before;
        lit_before = true;
      }
      image.f_number = shot.f_number;
      image.camera_distance_m = shot.camera_distance_m;
      image.focus_distance_m = shot.focus_distance_m;
      image.laser_distance_m = shot.laser_distance_m;
      image.roi_columns_px = columns;
      image.roi_rows_px = rows;
      constexpr int kRim_px = 8;
      const int column_reach = set.camera.columns_px / 2 - columns / 2 - kRim_px;
      const int row_reach = (set.camera.rows_px / 2 - rows / 2 - kRim_px) * 4 / 5 / 2 * 2;
      image.roi_column_px = shot.field_column * column_reach - columns / 2;
      image.roi_row_px = shot.field_row * row_reach - rows / 2;
      const double b = 1 / (1 / set.focal_length_m - 1 / shot.focus_distance_m);
      // The projector moves so that the line stays in the region.
      image.line_offset_m = Rounded(
          shot.field_row * row_reach * set.camera.pixel_pitch_m * shot.camera_distance_m / b, 3);
      image.exposure_time_s = shot.exposure;
      set.recordings.push_back(image);
      if (!shot.dark) {
        const double rate =
            CrestElectronsPerSecond(set, static_cast<int>(set.recordings.size()) - 1);
        set.recordings.back().exposure_time_s = Rounded(
            (repeated ? 1 : jitter) * shot.exposure * crest_share * full_electrons / rate, 2);
      }
      const RecordedImage& added = set.recordings.back();
      const Setup setup = {shot.dark,
                           added.exposure_time_s,
                           added.f_number,
                           added.camera_distance_m,
                           added.focus_distance_m,
                           added.laser_distance_m,
                           added.roi_column_px,
                           added.roi_row_px};
      const int group = static_cast<int>(repeat_groups.size());
      set.recordings.back().repeat_group = repeat_groups.emplace(setup, group).first->second;
    }
  }
  return set;
}

SetupDeviation DrawDeviation(const SetupDeviation& uncertainty, uint64_t seed) {
  SetupDeviation deviation = uncertainty;
  const uint64_t own = DeriveSeed(seed, "deviation");
  for (int i = 0; i < kDeviations; ++i) {
    DeviationAt(deviation, i) *= std::clamp(CounterRandom(own, i).Normal(), -2.0, 2.0);
  }
  return deviation;
}

}  // namespace sightline::bench
