// SPDX-License-Identifier: Apache-2.0
#include "tests/render_worker/effects/test_frame.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "core/random/counter_random.h"

namespace sightline {

FrameSetup TestFrame() {
  FrameSetup frame;
  frame.sensor.colour_filter = ColourFilter::kBayerRggb;
  for (QuantumEfficiencyCurve& curve : frame.sensor.quantum_efficiency) {
    curve.wavelength_m = {600e-9, 700e-9};
    curve.quantum_efficiency = {0.5, 0.4};
  }
  frame.sensor.dark_mean_electrons = 15;
  frame.sensor.dark_noise_electrons = 4;
  frame.sensor.prnu_relative = 0.006;
  frame.sensor.dsnu_electrons = 1.3;
  frame.lens.focal_length_m = 0.016;
  frame.lens.f_number = 4;
  frame.lens.focus_distance_m = 0.34;
  frame.lens.transmission = 0.9;
  frame.laser.power_w = 4e-4;
  frame.laser.divergence_rad = 1e-3;
  frame.laser.beam_focus_distance_m = 0.43;
  frame.laser.fan_angle_rad = 0.75;
  frame.plate = {0.343, 0.39, std::numbers::pi / 4, 1.1e-3};
  frame.roi = {-20, -12, 40, 25};
  frame.seeds = {11, 12, 13, 14};
  frame.exposure_time_s = 3.7e-3;
  frame.timestamp_s = 123.4;
  return frame;
}

OpticsModel TestOptics(const FrameSetup& frame) {
  OpticsModel optics;
  Pupil pupil;
  pupil.radius_m = 0.5 * frame.PupilDiameter();
  optics.pupil = [pupil](double, double) { return pupil; };
  const double b = frame.ImageDistance();
  const double f = frame.lens.focal_length_m;
  optics.curvature = [b, f](double depth_m, double, double) { return 1 / f - 1 / depth_m - 1 / b; };
  optics.image_distance_m = b;
  optics.wavelength_m = frame.laser.wavelength_m;
  optics.reference_pupil_radius_m = pupil.radius_m;
  return optics;
}

PlateScene TestScene(const FrameSetup& frame) { return MakePlateScene(frame); }

Image<double> RandomElectrons(const FrameSetup& frame, uint64_t seed, double largest) {
  Image<double> image(frame.roi.columns_px, frame.roi.rows_px);
  for (size_t i = 0; i < image.values.size(); ++i) {
    image.values[i] = largest * CounterRandom(seed, i).Uniform();
  }
  return image;
}

PixelIrradiance RandomLight(const FrameSetup& frame, uint64_t seed) {
  PixelIrradiance light;
  light.roi = frame.roi;
  light.laser_irradiance_w_m2 = Image<float>(frame.roi.columns_px, frame.roi.rows_px);
  for (Image<float>& flux : light.incoherent_electron_flux_m2_s) {
    flux = light.laser_irradiance_w_m2;
    for (size_t i = 0; i < flux.values.size(); ++i) {
      flux.values[i] = 1e10F * CounterRandom(seed + 1, i).UniformFloat();
    }
  }
  for (size_t i = 0; i < light.laser_irradiance_w_m2.values.size(); ++i) {
    light.laser_irradiance_w_m2.values[i] = CounterRandom(seed, i).UniformFloat();
  }
  return light;
}

const Effect& TheEffect(const std::string& id) {
  const Effect* effect = FindEffect(id);
  assert(effect != nullptr);
  return *effect;
}

std::vector<double> WithParameters(const Effect& effect,
                                   const std::vector<std::pair<std::string, double>>& values) {
  std::vector<NamedValue> named;
  for (const auto& [name, value] : values) named.push_back({name, value});
  const absl::StatusOr<ActiveEffect> active = MakeActiveEffect(effect.description().id, named);
  assert(active.ok());
  return active->parameters;
}

std::complex<double> Transfer(const OpticsModel& optics, double qx, double qy) {
  std::complex<double> product = 1;
  for (const TransferFunction& transfer : optics.transfer) product *= transfer(qx, qy);
  return product;
}

double Sum(const Image<double>& image) {
  double sum = 0;
  for (const double value : image.values) sum += value;
  return sum;
}

}  // namespace sightline
