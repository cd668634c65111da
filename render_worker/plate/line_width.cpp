// SPDX-License-Identifier: Apache-2.0
#include "render_worker/plate/line_width.h"

#include <cmath>

#include "render_worker/plate/plate_scene.h"

namespace sightline {

double DefocusRadiusPx(const FrameSetup& frame) {
  const double b = frame.ImageDistance();
  const double object_b = 1 / (1 / frame.lens.focal_length_m - 1 / frame.plate.camera_distance_m);
  return frame.PupilDiameter() * std::abs(1 - b / object_b) / 2 / frame.sensor.pixel_pitch_m;
}

double NominalWidthPx(const FrameSetup& frame) {
  const double b = frame.ImageDistance();
  const double magnification = b / frame.plate.camera_distance_m;
  const double beam_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) / 2 * magnification /
                        std::cos(frame.plate.incidence_angle_rad);
  const double diffraction_m = 0.5 * frame.laser.wavelength_m * b / frame.PupilDiameter();
  return std::hypot(std::hypot(beam_m, diffraction_m) / frame.sensor.pixel_pitch_m,
                    DefocusRadiusPx(frame) / 2);
}

}  // namespace sightline
