// SPDX-License-Identifier: Apache-2.0
#include "tests/render_worker/diagnosis/rendered_set.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"

namespace sightline {

RecordingSet SmallSetDescription() {
  RecordingSet set;
  set.name = "small";
  set.camera.quantum_efficiency[0] = {{661e-9}, {0.5}};
  set.camera.gain_dn_per_electron = 0.16;
  set.camera.dark_mean_electrons = 28;
  set.camera.dark_noise_electrons = 6.5;
  set.camera.saturation_capacity_electrons = 20000;
  set.focal_length_m = 0.016;
  set.transmission = 0.9;
  set.laser.wavelength_m = 661e-9;
  set.laser.power_w = 6e-4;
  set.laser.divergence_rad = 1e-3;
  set.laser.beam_focus_distance_m = 0.44;
  set.laser.fan_angle_rad = 0.64;
  set.surface = {0.35, 0.6, 0.4};
  set.incidence_angle_rad = std::numbers::pi / 4;
  set.uncertainty.camera_distance_m = 2e-3;
  set.uncertainty.focus_distance_relative = 0.015;
  set.uncertainty.f_number_relative = 0.015;
  set.uncertainty.divergence_relative = 0.02;
  set.uncertainty.power_relative = 0.05;
  set.uncertainty.diffuse_albedo_relative = 0.05;
  set.uncertainty.gain_relative = 0.01;
  set.uncertainty.dark_mean_electrons = 0.3;
  set.uncertainty.dark_noise_relative = 0.03;
  set.uncertainty.line_position_common_px = 1.5;
  set.uncertainty.line_position_each_px = 0.3;
  int position = 1;
  const auto add = [&](RecordingKind kind, double exposure_s, double f_number, double distance_m,
                       bool same_place) {
    RecordedImage image;
    image.kind = kind;
    image.timestamp_s = 20.0 * static_cast<double>(set.recordings.size());
    image.exposure_time_s = exposure_s;
    image.f_number = f_number;
    image.camera_distance_m = distance_m;
    image.focus_distance_m = 0.33;
    image.laser_distance_m = 0.36;
    if (kind == RecordingKind::kLaser) {
      if (!same_place) ++position;
      image.plate_position_id = position;
      image.same_speckle = same_place;
    }
    image.repeat_group = static_cast<int>(set.recordings.size());
    image.roi_column_px = -96;
    image.roi_row_px = -64;
    image.roi_columns_px = 192;
    image.roi_rows_px = 128;
    set.recordings.push_back(image);
  };
  constexpr auto kLaser = RecordingKind::kLaser;
  constexpr auto kDark = RecordingKind::kDark;
  for (const double n : {2.8, 4.0, 5.6, 8.0, 11.0}) add(kLaser, 4e-5 * n * n, n, 0.33, false);
  for (const double d : {0.25, 0.30, 0.40}) add(kLaser, 6.4e-4, 4, d, false);
  add(kLaser, 5e-4, 8, 0.33, false);
  add(kLaser, 2e-3, 8, 0.33, true);
  add(kLaser, 5e-3, 8, 0.33, true);
  for (const double t : {1e-4, 0.02, 0.2}) add(kDark, t, 8, 0.33, false);
  return set;
}

RecordedSet RenderSmallSet(const SetupDeviation& deviation,
                           const std::vector<ActiveEffect>& effects, uint64_t seed) {
  RecordingSet set = SmallSetDescription();
  std::vector<Image<uint16_t>> raw_dn;
  for (size_t i = 0; i < set.recordings.size(); ++i) {
    const FrameSetup frame = PlateFrame(set, static_cast<int>(i), {deviation, seed});
    raw_dn.push_back(RenderPlateFrame(frame, effects, nullptr, 1)->raw_dn);
  }
  return MakeRecordedSet(std::move(set), std::move(raw_dn));
}

SetupDeviation SomeDeviations() {
  SetupDeviation deviation;
  deviation.camera_distance_m = 2e-3;
  deviation.focus_distance_relative = -0.02;
  deviation.f_number_relative = 0.015;
  deviation.power_relative = -0.06;
  deviation.dark_mean_electrons = 0.4;
  deviation.line_position_common_px = 1.1;
  deviation.line_position_each_px = 0.3;
  return deviation;
}

FitResult FitNull(const SetModel& model) {
  SetParameters start;
  start.line_shift_px = EstimateLineShifts(model, start);
  return FitSet(model, start, {}, {}, nullptr);
}

void FailInReciprocity(RecordedSet* set) {
  double shortest = 1e300;
  for (const RecordedFrame& frame : set->frames) {
    if (frame.plate_position_id >= 0) {
      shortest = std::min(shortest, frame.nominal.exposure_time_s);
    }
  }
  for (RecordedFrame& frame : set->frames) {
    if (frame.plate_position_id < 0) continue;
    const double factor = std::pow(shortest / frame.nominal.exposure_time_s, 0.35);
    for (uint16_t& value : frame.raw_dn.values) {
      value = static_cast<uint16_t>(std::lround(3 + factor * std::max(0.0, value - 3.0)));
    }
  }
}

}  // namespace sightline
