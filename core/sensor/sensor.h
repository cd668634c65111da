// SPDX-License-Identifier: Apache-2.0
// Data sheet values of a camera's sensor, in the quantities of EMVA 1288 Release 4.0.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/sensor.pb.h"

namespace sightline {

enum class ColourFilter { kMono, kBayerRggb };

// Quantum efficiency of one channel, fill factor included, in [0, 1]. Linear between the points,
// constant beyond them; wavelengths ascend. One point: the same everywhere.
struct QuantumEfficiencyCurve {
  std::vector<double> wavelength_m;
  std::vector<double> quantum_efficiency;

  double At(double wavelength_m) const;
};

inline constexpr int kRed = 0, kGreen = 1, kBlue = 2;

// Linear camera model (EMVA 1288 R4.0 Linear, section 2). Fill factor 1, square pixels.
struct Sensor {
  std::string name;
  ColourFilter colour_filter = ColourFilter::kMono;
  double pixel_pitch_m = 5.3e-6;
  int columns_px = 1280;
  int rows_px = 1024;
  int bit_depth_bit = 10;
  double gain_dn_per_electron = 0.16;           // K
  double saturation_capacity_electrons = 9893;  // N_sat: the pixel holds no more
  double dark_mean_electrons = 0;               // mu_d at zero exposure time, as read out
  double dark_noise_electrons = 0;              // sigma_d, temporal, without light
  double dark_current_electrons_per_s = 0;      // mu_I at the reference temperature
  double dark_current_reference_temperature_c = 25;
  double dark_current_doubling_k = 8;  // kelvin that double the dark current
  double prnu_relative = 0;            // standard deviation of the pixels' sensitivity
  double dsnu_electrons = 0;           // standard deviation of the pixels' offset
  double black_level_dn = 0;           // added before quantisation
  // One curve for mono sensors; red, green, blue for Bayer sensors.
  std::array<QuantumEfficiencyCurve, 3> quantum_efficiency;

  int channels() const { return colour_filter == ColourFilter::kMono ? 1 : 3; }
  double largest_dn() const { return static_cast<double>((1 << bit_depth_bit) - 1); }
  // Channel of a pixel: kRed, kGreen or kBlue (0 on mono sensors). Even row and column: red; odd,
  // odd: blue (RGGB). Row and column may be negative (regions left of the principal point).
  int ChannelAt(int row, int column) const;
};

// The channel with the largest quantum efficiency at a wavelength: kRed, kGreen or kBlue, the first
// one in a tie; 0 for mono sensors.
int MostSensitiveChannel(const Sensor& sensor, double wavelength_m);

// Validates a message; `context` (e.g. the file name) starts every error message.
// INVALID_ARGUMENT names the field, its value and the allowed range: gain <= 0, quantum efficiency
// outside [0, 1], missing curve of a channel, ...
absl::StatusOr<Sensor> ParseSensor(const v1::Sensor& message, const std::string& context);
// A camera file: JSON form of v1.Sensor.
absl::StatusOr<Sensor> ReadSensorFile(const std::string& path);
v1::Sensor SensorToProto(const Sensor& sensor);

}  // namespace sightline
