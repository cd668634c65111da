// SPDX-License-Identifier: Apache-2.0
// The EMVA 1288 procedure carried out on the simulated sensor: the values of its data sheet.
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
  double exposure_time_s = 1e-3;            // light varies, the time does not
  double longest_dark_exposure_time_s = 5;  // shorter where the dark charge would near saturation
  uint64_t seed = 1;
};

struct Characterisation {
  PhotonTransfer photon_transfer;
  DarkCurrent dark_current;  // at the reference temperature
  // Unset: the dark current is not significantly above zero.
  std::optional<DarkCurrentOverTemperature> over_temperature;
  NonUniformity non_uniformity;
};

// Takes the images (flat light, dark frames, four temperatures 7 K apart from the reference
// temperature up) and evaluates them. Errors: those of the measurements.
absl::StatusOr<Characterisation> CharacteriseSensor(const Sensor& sensor,
                                                    const CharacterisationSetup& setup);

// Charge at which the signal is clipped without noise: by the pixel or by the converter.
double ClippingChargeElectrons(const Sensor& sensor);

}  // namespace sightline
