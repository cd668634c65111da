// SPDX-License-Identifier: Apache-2.0
// Runs the EMVA 1288 procedure on the simulated sensor and returns its data-sheet values.
#pragma once

#include <cstdint>
#include <optional>

#include "absl/status/statusor.h"
#include "core/sensor/sensor.h"
#include "render_worker/sensor/emva1288_measurement.h"

namespace sightline {

struct CharacterisationSetup {
  double wavelength_m = 660e-9;
  int channel = 0;
  int size_px = 256;        // square region, even
  int exposure_steps = 60;  // of the photon transfer, equally spaced (clause 6.5: at least 50)
  int stack_frames = 100;   // for DSNU and PRNU, dark and bright
  double exposure_time_s = 1e-3;  // the light varies, the exposure time is constant
  double longest_dark_exposure_time_s =
      5;  // shortened if the dark charge would approach saturation
  uint64_t seed = 1;
};

struct Characterisation {
  PhotonTransfer photon_transfer;
  DarkCurrent dark_current;  // at the reference temperature
  // Unset: the dark current is not significantly above zero.
  std::optional<DarkCurrentOverTemperature> over_temperature;
  NonUniformity non_uniformity;
};

// Simulates the images (flat light, dark frames, four temperatures from the reference temperature
// upwards in steps of 7 K) and evaluates them. Errors of the measurements.
absl::StatusOr<Characterisation> CharacteriseSensor(const Sensor& sensor,
                                                    const CharacterisationSetup& setup);

// Charge at which the signal is clipped without noise: by the pixel or by the converter.
double ClippingChargeElectrons(const Sensor& sensor);

}  // namespace sightline
