// SPDX-License-Identifier: Apache-2.0
// The nine parameters of one linear scan (thesis section 2.4.1, Fig. 2.2, Table 2.1).
#pragma once

#include <array>

namespace sightline {

// Angles in radians, lengths in metres.
struct Measurement {
  double camera_distance_m = 0.4;
  // Signed angle from camera to laser about the origin; the laser's polar angle is
  // camera_polar_rad - triangulation_angle_rad.
  double triangulation_angle_rad = 0.5;
  double camera_azimuth_rad = 0;
  double camera_polar_rad = 0;
  double part_alpha_rad = 0;
  double part_beta_rad = 0;
  double part_gamma_rad = 0;
  double offset_y_m = 0;
  double offset_z_m = 0;

  friend bool operator==(const Measurement&, const Measurement&) = default;
};

// Index of a parameter in the order of the struct: into ToArray, and into the parameters of a
// measurement domain.
enum MeasurementParameter {
  kCameraDistance,
  kTriangulationAngle,
  kCameraAzimuth,
  kCameraPolar,
  kPartAlpha,
  kPartBeta,
  kPartGamma,
  kOffsetY,
  kOffsetZ,
};

inline constexpr int kMeasurementParameters = 9;

// Names of the parameters in files and messages (v1::Measurement), where angles are in degrees.
inline constexpr std::array<const char*, kMeasurementParameters> kMeasurementParameterNames = {
    "camera_distance_m", "triangulation_angle_deg", "camera_azimuth_deg", "camera_polar_deg",
    "part_alpha_deg",    "part_beta_deg",           "part_gamma_deg",     "offset_y_m",
    "offset_z_m"};

// The parameters in the order of the struct.
std::array<double, kMeasurementParameters> ToArray(const Measurement& measurement);
Measurement FromArray(const std::array<double, kMeasurementParameters>& parameters);

}  // namespace sightline
