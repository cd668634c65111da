// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/characterise_sensor.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/physics/constants.h"
#include "core/status/status_macros.h"
#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

// A camera that looks into an integrating sphere; every image has noise of its own.
class SimulatedCamera {
 public:
  SimulatedCamera(const Sensor& sensor, const CharacterisationSetup& setup) : setup_(setup) {
    frame_.sensor = sensor;
    frame_.laser.wavelength_m = setup.wavelength_m;
    frame_.roi = {-setup.size_px / 2, -setup.size_px / 2, setup.size_px, setup.size_px};
    frame_.seeds.camera = setup.seed;
  }

  Image<uint16_t> Take(double photons, double exposure_time_s, double temperature_c) {
    frame_.exposure_time_s = exposure_time_s;
    frame_.sensor_temperature_c = temperature_c;
    frame_.seeds.noise = DeriveSeedOfImage();
    const double pitch_m = frame_.sensor.pixel_pitch_m;
    PixelIrradiance light;
    light.roi = frame_.roi;
    light.laser_irradiance_w_m2 = Image<float>(
        frame_.roi.columns_px, frame_.roi.rows_px,
        static_cast<float>(photons * (kPlanck_j_s * kSpeedOfLight_m_per_s) /
                           (setup_.wavelength_m * pitch_m * pitch_m * exposure_time_s)));
    const Image<uint16_t> raw =
        Digitise(CollectElectrons(MeanPhotoElectrons(light, frame_), frame_), frame_.sensor);
    return ChannelPixels(raw, frame_.sensor, frame_.roi, setup_.channel);
  }
  PairStatistics TakePair(double photons, double exposure_time_s, double temperature_c) {
    const Image<uint16_t> first = Take(photons, exposure_time_s, temperature_c);
    return StatisticsOfPair(first, Take(photons, exposure_time_s, temperature_c));
  }

 private:
  uint64_t DeriveSeedOfImage() { return setup_.seed * 1000003 + ++images_; }

  CharacterisationSetup setup_;
  FrameSetup frame_;
  uint64_t images_ = 0;
};

}  // namespace

double ClippingChargeElectrons(const Sensor& sensor) {
  return std::min(sensor.saturation_capacity_electrons,
                  (sensor.largest_dn() - sensor.black_level_dn) / sensor.gain_dn_per_electron);
}

absl::StatusOr<Characterisation> CharacteriseSensor(const Sensor& sensor,
                                                    const CharacterisationSetup& setup) {
  SimulatedCamera camera(sensor, setup);
  const double reference_c = sensor.dark_current_reference_temperature_c;
  const double full_electrons = ClippingChargeElectrons(sensor) - sensor.dark_mean_electrons;
  const double full_photons =
      full_electrons / sensor.quantum_efficiency[setup.channel].At(setup.wavelength_m);

  std::vector<ExposureStep> steps;
  for (int i = 1; i <= setup.exposure_steps; ++i) {
    ExposureStep step;
    step.photons = 1.15 * full_photons * i / setup.exposure_steps;
    step.exposure_time_s = setup.exposure_time_s;
    step.bright = camera.TakePair(step.photons, step.exposure_time_s, reference_c);
    step.dark = camera.TakePair(0, step.exposure_time_s, reference_c);
    steps.push_back(step);
  }
  Characterisation result;
  SIGHTLINE_ASSIGN_OR_RETURN(PhotonTransfer transfer, MeasurePhotonTransfer(steps));
  result.photon_transfer = transfer;
  const Estimate& gain = transfer.gain_dn_per_electron;

  std::vector<TemperatureStep> temperatures;
  bool measurable = true;
  for (int i = 0; i < 4; ++i) {
    const double temperature_c = reference_c + 7 * i;
    const double current =
        sensor.dark_current_electrons_per_s * std::exp2(7 * i / sensor.dark_current_doubling_k);
    double longest_s = setup.longest_dark_exposure_time_s;
    if (current * longest_s > 0.3 * full_electrons) longest_s = 0.3 * full_electrons / current;
    std::vector<DarkStep> dark;
    for (int j = 1; j <= 6; ++j) {
      const double time_s = longest_s * j / 6;
      dark.push_back({time_s, camera.TakePair(0, time_s, temperature_c)});
    }
    SIGHTLINE_ASSIGN_OR_RETURN(DarkCurrent measured, MeasureDarkCurrent(dark, gain));
    if (i == 0) result.dark_current = measured;
    const Estimate& estimate = measured.from_mean_electrons_per_s;
    measurable = measurable && estimate.value > 5 * estimate.standard_error;
    temperatures.push_back({temperature_c, estimate});
  }
  if (measurable) {
    SIGHTLINE_ASSIGN_OR_RETURN(result.over_temperature,
                               MeasureDoublingTemperature(temperatures, reference_c));
  }

  FrameStack dark, bright;
  const double half = 0.5 * transfer.saturation_photons.value;
  for (int i = 0; i < setup.stack_frames; ++i) {
    dark.Add(camera.Take(0, setup.exposure_time_s, reference_c));
    bright.Add(camera.Take(half, setup.exposure_time_s, reference_c));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(result.non_uniformity, MeasureNonUniformity(dark, bright, gain));
  return result;
}

}  // namespace sightline
