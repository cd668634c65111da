// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor/expose.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "core/physics/constants.h"
#include "core/random/counter_random.h"
#include "render_worker/sensor/poisson.h"

namespace sightline {
namespace {

constexpr double kLargestMean = 4e8;

// Number of a pixel's random stream, by its row and column from the principal point.
uint64_t PixelStream(int row, int column) {
  return static_cast<uint64_t>(static_cast<uint32_t>(row)) << 32 | static_cast<uint32_t>(column);
}

}  // namespace

Image<double> MeanPhotoElectrons(const PixelIrradiance& light, const FrameSetup& frame,
                                 const PixelPlane* plane) {
  const PixelPlane pixels = plane != nullptr ? *plane : PixelPlane{};
  const Sensor& sensor = frame.sensor;
  const int columns = light.roi.columns_px, rows = light.roi.rows_px;
  Image<double> electrons(columns, rows);
  if (!frame.shutter_open) return electrons;

  const double area_time = sensor.pixel_pitch_m * sensor.pixel_pitch_m * frame.exposure_time_s;
  const double wavelength_m = frame.laser.wavelength_m;
  const bool laser = frame.laser_on && !light.laser_irradiance_w_m2.empty();
  std::array<double, 3> laser_factor{};
  for (int channel = 0; channel < sensor.channels(); ++channel) {
    laser_factor[channel] = sensor.quantum_efficiency[channel].At(wavelength_m) * area_time *
                            wavelength_m / (kPlanck_j_s * kSpeedOfLight_m_per_s);
  }
  for (int i = pixels.first_row; i < rows; i += pixels.step) {
    for (int j = pixels.first_column; j < columns; j += pixels.step) {
      const int channel = sensor.ChannelAt(light.roi.row_px + i, light.roi.column_px + j);
      double mean = laser ? laser_factor[channel] * light.laser_irradiance_w_m2.At(i, j) : 0;
      const Image<float>& flux = light.incoherent_electron_flux_m2_s[channel];
      if (!flux.empty()) mean += area_time * flux.At(i, j);
      electrons.At(i, j) = std::max(mean, 0.0);
    }
  }
  return electrons;
}

double DarkMeanDn(const Sensor& sensor) {
  return sensor.gain_dn_per_electron * sensor.dark_mean_electrons + sensor.black_level_dn;
}

double DarkCurrentElectrons(const FrameSetup& frame) {
  const Sensor& sensor = frame.sensor;
  const double doublings =
      (frame.sensor_temperature_c - sensor.dark_current_reference_temperature_c) /
      sensor.dark_current_doubling_k;
  return sensor.dark_current_electrons_per_s * frame.exposure_time_s * std::exp2(doublings);
}

Image<double> CollectElectrons(const Image<double>& mean_photo_electrons, const FrameSetup& frame,
                               const PixelPlane* plane) {
  const PixelPlane pixels = plane != nullptr ? *plane : PixelPlane{};
  const Sensor& sensor = frame.sensor;
  assert(mean_photo_electrons.columns_px == frame.roi.columns_px);
  assert(mean_photo_electrons.rows_px == frame.roi.rows_px);
  const uint64_t noise_seed = DeriveSeed(frame.seeds.noise, "exposure");
  const uint64_t pattern_seed = DeriveSeed(frame.seeds.camera, "fixed pattern");
  const bool pattern = sensor.prnu_relative != 0 || sensor.dsnu_electrons != 0;
  const double dark_electrons = std::min(DarkCurrentElectrons(frame), kLargestMean);

  Image<double> electrons(mean_photo_electrons.columns_px, mean_photo_electrons.rows_px);
  for (int i = pixels.first_row; i < electrons.rows_px; i += pixels.step) {
    for (int j = pixels.first_column; j < electrons.columns_px; j += pixels.step) {
      const uint64_t stream = PixelStream(frame.roi.row_px + i, frame.roi.column_px + j);
      double mean = mean_photo_electrons.At(i, j);
      double offset = sensor.dark_mean_electrons;
      if (pattern) {
        CounterRandom random(pattern_seed, stream);
        const std::array<double, 2> normal = random.NormalPair();
        mean *= std::max(1 + sensor.prnu_relative * normal[0], 0.0);
        offset += sensor.dsnu_electrons * normal[1];
      }
      CounterRandom random(noise_seed, stream);
      // The sum of two Poisson numbers is one of the summed means. Beyond kLargestMean every pixel
      // is full; NaN counts as no light.
      mean = mean > 0 ? std::min(mean, kLargestMean) : 0;
      double charge = PoissonNumber(mean + dark_electrons, random) + offset;
      if (sensor.dark_noise_electrons > 0) charge += sensor.dark_noise_electrons * random.Normal();
      electrons.At(i, j) = std::clamp(charge, 0.0, sensor.saturation_capacity_electrons);
    }
  }
  return electrons;
}

Image<uint16_t> Digitise(const Image<double>& electrons, const Sensor& sensor) {
  Image<uint16_t> raw(electrons.columns_px, electrons.rows_px);
  const double largest = sensor.largest_dn();
  for (size_t i = 0; i < electrons.values.size(); ++i) {
    const double dn =
        std::floor(sensor.gain_dn_per_electron * electrons.values[i] + sensor.black_level_dn + 0.5);
    raw.values[i] = static_cast<uint16_t>(std::clamp(dn, 0.0, largest));
  }
  return raw;
}

}  // namespace sightline
