// SPDX-License-Identifier: Apache-2.0
// The numbers of one frame, which the effects of the setup stage change.
#pragma once

#include <cstdint>

#include "core/rig/rig.h"
#include "core/sensor/sensor.h"

namespace sightline {

// Region of the sensor that is read out. The position of its first pixel is relative to the
// principal point, the centre of pixel (rows/2, columns/2) of the sensor.
struct RegionOfInterest {
  int column_px = 0;
  int row_px = 0;
  int columns_px = 0;
  int rows_px = 0;
};

// The whole sensor.
inline RegionOfInterest FullFrame(const Sensor& sensor) {
  return {-(sensor.columns_px / 2), -(sensor.rows_px / 2), sensor.columns_px, sensor.rows_px};
}

// Lambert + GGX with Schlick F0 (recordings format, section 3): everywhere on the plate.
struct PlateSurface {
  double diffuse_albedo = 0.35;
  double specular_f0 = 0.6;
  double ggx_alpha = 0.4;
};

// A flat plate perpendicular to the optical axis, lit by the laser line along X.
struct PlateGeometry {
  double camera_distance_m = 0.3;
  double laser_distance_m = 0.36;
  double incidence_angle_rad = 0.7853981633974483;
  double line_offset_m = 0;  // position of the line on the plate, across it
};

// Seeds of random values: those that differ between frames, and those that do not.
struct FrameSeeds {
  uint64_t speckle = 0;  // the same for the same surface position
  uint64_t noise = 0;    // photons and temporal noise of this frame
  uint64_t camera = 0;   // fixed pattern of this camera
  uint64_t rig = 0;      // values that an effect draws once per set (ripple phase, dust, texture)
};

// One frame. For parts, `plate` and `surface` are ignored.
struct FrameSetup {
  Sensor sensor;
  Lens lens;  // focus_distance_m is set
  Laser laser;
  PlateSurface surface;
  PlateGeometry plate;
  RegionOfInterest roi;
  FrameSeeds seeds;
  bool laser_on = true;
  bool shutter_open = true;  // false: a dark frame without any light
  double exposure_time_s = 0.01;
  double timestamp_s = 0;  // since the laser was switched on
  int burst_frame_index = 0;
  // Rolling shutter: delay of a row's exposure after that of the row above; 0: global shutter.
  double row_time_s = 0;
  int recording_index = 0;  // in order of time
  double sensor_temperature_c = 25;
  // Shares of the irradiance of independent speckle patterns; their sum is 1.
  std::vector<double> speckle_pattern_weights = {1};
  bool speckle = true;  // false: laser light is imaged incoherently
  int sub_pixels = 0;   // per pixel and axis; 0: as many as the pupil needs

  // Image distance of the focused plane, b = 1/(1/f - 1/d_foc) [m]; lens.focus_distance_m is set.
  double ImageDistance() const {
    return 1 / (1 / lens.focal_length_m - 1 / lens.focus_distance_m.value());
  }
  // Diameter f/N of the pupil [m].
  double PupilDiameter() const { return lens.focal_length_m / lens.f_number; }
};

}  // namespace sightline
