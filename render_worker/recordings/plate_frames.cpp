// SPDX-License-Identifier: Apache-2.0
#include "render_worker/recordings/plate_frames.h"

#include <algorithm>
#include <cassert>

#include "core/random/counter_random.h"

namespace sightline {

FrameSetup PlateFrame(const RecordingSet& set, int index, const PlateFrameOptions& options) {
  assert(set.format_version == 1);
  const RecordedImage& image = set.recordings[static_cast<size_t>(index)];
  const SetupDeviation& d = options.deviation;
  FrameSetup frame;
  frame.sensor = set.camera;
  for (QuantumEfficiencyCurve& curve : frame.sensor.quantum_efficiency) {
    for (double& efficiency : curve.quantum_efficiency) {
      efficiency = std::min(1.0, efficiency * (1 + d.quantum_efficiency_relative));
    }
  }
  frame.sensor.gain_dn_per_electron *= 1 + d.gain_relative;
  frame.sensor.dark_mean_electrons += d.dark_mean_electrons;
  frame.sensor.dark_noise_electrons *= 1 + d.dark_noise_relative;
  frame.sensor_temperature_c = frame.sensor.dark_current_reference_temperature_c;

  frame.lens.focal_length_m = set.focal_length_m;
  frame.lens.transmission = std::min(1.0, set.transmission * (1 + d.transmission_relative));
  frame.lens.f_number = image.f_number * (1 + d.f_number_relative);
  frame.lens.focus_distance_m = image.focus_distance_m * (1 + d.focus_distance_relative);

  frame.laser = set.laser;
  frame.laser.power_w *= 1 + d.power_relative;
  frame.laser.divergence_rad *= 1 + d.divergence_relative;
  frame.laser.beam_focus_distance_m += d.beam_focus_distance_m;

  frame.surface.diffuse_albedo =
      std::min(1.0, set.surface.diffuse_albedo * (1 + d.diffuse_albedo_relative));
  frame.surface.specular_f0 = std::min(1.0, set.surface.specular_f0 * (1 + d.specular_f0_relative));
  frame.surface.ggx_alpha = set.surface.ggx_alpha * (1 + d.ggx_alpha_relative);

  frame.plate.camera_distance_m = image.camera_distance_m + d.camera_distance_m;
  frame.plate.laser_distance_m = image.laser_distance_m + d.laser_distance_m;
  frame.plate.incidence_angle_rad = set.incidence_angle_rad + d.incidence_angle_rad;
  double line_shift_px = d.line_position_common_px;
  if (image.plate_position_id) {
    const uint64_t seed =
        DeriveSeed(options.seed, "line position", static_cast<uint64_t>(*image.plate_position_id));
    line_shift_px += d.line_position_each_px * std::clamp(CounterRandom(seed, 0).Normal(), -2., 2.);
  }
  const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
  frame.plate.line_offset_m =
      image.line_offset_m + line_shift_px * frame.sensor.pixel_pitch_m / magnification;

  frame.roi = {image.roi_column_px, image.roi_row_px, image.roi_columns_px, image.roi_rows_px};
  frame.seeds.speckle = DeriveSeed(options.seed, "speckle",
                                   static_cast<uint64_t>(image.plate_position_id.value_or(-1)));
  frame.seeds.noise = DeriveSeed(options.seed, "noise", static_cast<uint64_t>(index));
  frame.seeds.camera = DeriveSeed(options.seed, "camera");
  frame.seeds.rig = DeriveSeed(options.seed, "rig");
  frame.laser_on = image.kind == RecordingKind::kLaser;
  frame.shutter_open = image.kind != RecordingKind::kDark;
  frame.exposure_time_s = image.exposure_time_s;
  frame.timestamp_s = image.timestamp_s;
  frame.burst_frame_index = image.burst_frame_index;
  frame.recording_index = index;
  frame.speckle = options.speckle;
  return frame;
}

}  // namespace sightline
