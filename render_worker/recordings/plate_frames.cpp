// SPDX-License-Identifier: Apache-2.0
#include "render_worker/recordings/plate_frames.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "core/random/counter_random.h"
#include "core/recordings/posed_plates.h"
#include "render_worker/plate/tilted_plate.h"

namespace sightline {

namespace {

// Gives the line of a plate perpendicular to the camera the width and brightness that it has in an
// oblique view (core/plate_line). The beam is made wider by changing both waist and divergence. The
// power makes up for the width, and for the reflectance between other directions. The reflectance
// is that of the surface here: effects that change the surface later act in the ratio of a
// perpendicular view.
void ApplyView(const ObliqueView& view, FrameSetup* frame) {
  const PlateGeometry& plate = frame->plate;
  const double radius_m = BeamRadius(frame->laser, plate.laser_distance_m);
  // Standard deviation of a line that whole-pixel shifts move within a column: twice as a radius.
  const double px_m =
      frame->sensor.pixel_pitch_m * plate.camera_distance_m / frame->ImageDistance();
  const double shifts_m =
      2 * std::sqrt(view.row_variance_px2) * px_m * std::cos(plate.incidence_angle_rad);
  const double wider = std::hypot(view.width_factor, shifts_m / radius_m);
  ObliqueView directions = view;
  directions.incidence_angle_rad = plate.incidence_angle_rad;
  const PlateSurface& surface = frame->surface;
  const double reflected =
      ObliqueBrdf(surface.diffuse_albedo, surface.specular_f0, surface.ggx_alpha, directions) /
      PlateBrdf(surface, plate.incidence_angle_rad);
  frame->laser.divergence_rad *= wider;
  frame->laser.beam_quality_m2 *= wider * wider;
  frame->laser.power_w *= view.width_factor * reflected;
}

// Depth of a recording's plate: of version 3 that of the middle of the line, or without one that in
// focus.
double PlateDepth(const RecordingSet& set, const RecordedImage& image) {
  if (set.format_version != 3) return image.camera_distance_m;
  if (!image.plate_in_camera) return image.focus_distance_m;
  const auto line = FindLineInRegion(*set.posed, set.camera, image);
  return line.ok() ? line->start_m.z() : image.focus_distance_m;
}

}  // namespace

FrameSetup PlateFrame(const RecordingSet& set, int index, const PlateFrameOptions& options) {
  assert(set.format_version != 2);
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

  frame.plate.camera_distance_m = PlateDepth(set, image) + d.camera_distance_m;
  frame.plate.laser_distance_m = image.laser_distance_m + d.laser_distance_m;
  frame.plate.incidence_angle_rad = set.IncidenceAngle(image) + d.incidence_angle_rad;
  double line_shift_px = d.line_position_common_px;
  if (image.plate_position_id) {
    const uint64_t seed =
        DeriveSeed(options.seed, "line position", static_cast<uint64_t>(*image.plate_position_id));
    line_shift_px += d.line_position_each_px * std::clamp(CounterRandom(seed, 0).Normal(), -2., 2.);
  }
  const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
  frame.plate.line_offset_m =
      image.line_offset_m + line_shift_px * frame.sensor.pixel_pitch_m / magnification;

  if (image.view) ApplyView(*image.view, &frame);

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

std::function<PlateScene(const FrameSetup&)> PlateOf(const RecordingSet& set, int index) {
  const RecordedImage& image = set.recordings[static_cast<size_t>(index)];
  if (set.format_version != 3 || !image.plate_in_camera) return MakePlateScene;
  const auto line = LineOnPlate(set.posed->sheet, *image.plate_in_camera);
  assert(line.ok() && set.posed->sheet.origin_m);
  return [posed = *set.posed, line = *line](const FrameSetup& frame) {
    return MakeTiltedPlateScene(frame, posed.camera, posed.sheet, line);
  };
}

}  // namespace sightline
