// SPDX-License-Identifier: Apache-2.0
// Every hook of every effect at its null parameters leaves what it is given bit-identical; a small
// parameter changes it little, and some parameter changes it at all.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/render_worker/effects/test_frame.h"

namespace sightline {
namespace {

// All numbers that hooks can change, read out of their arguments.
std::vector<double> Numbers(const FrameSetup& frame) {
  const Sensor& s = frame.sensor;
  std::vector<double> n = {s.gain_dn_per_electron,
                           s.saturation_capacity_electrons,
                           s.dark_mean_electrons,
                           s.dark_noise_electrons,
                           s.dark_current_electrons_per_s,
                           s.prnu_relative,
                           s.dsnu_electrons,
                           s.black_level_dn,
                           frame.lens.focal_length_m,
                           frame.lens.f_number,
                           frame.lens.focus_distance_m.value(),
                           frame.lens.transmission,
                           static_cast<double>(frame.lens.aperture_blades),
                           frame.lens.distortion.k1,
                           frame.lens.distortion.p1,
                           frame.lens.distortion.p2,
                           frame.laser.wavelength_m,
                           frame.laser.power_w,
                           frame.laser.divergence_rad,
                           frame.laser.beam_focus_distance_m,
                           frame.laser.beam_quality_m2,
                           frame.laser.fan_angle_rad,
                           frame.surface.diffuse_albedo,
                           frame.surface.specular_f0,
                           frame.surface.ggx_alpha,
                           frame.plate.camera_distance_m,
                           frame.plate.laser_distance_m,
                           frame.plate.incidence_angle_rad,
                           frame.plate.line_offset_m,
                           frame.exposure_time_s,
                           frame.timestamp_s};
  for (const QuantumEfficiencyCurve& curve : s.quantum_efficiency) {
    n.insert(n.end(), curve.quantum_efficiency.begin(), curve.quantum_efficiency.end());
  }
  return n;
}

std::vector<double> Numbers(const PlateScene& scene) {
  std::vector<double> n = {scene.constant_along_line ? 1.0 : 0.0};
  for (int i = 0; i < 300; ++i) {
    const int row = i / 20;
    const double x = -0.02 + 0.04 * (i % 20) / 19, s = 1.1e-3 + 4e-4 * (row - 7);
    n.push_back(scene.laser_irradiance_w_m2(x, s));
    n.push_back(scene.brdf_per_sr(x, s));
    n.push_back(scene.height_m ? scene.height_m(x, s) : 0);
    n.push_back(scene.ambient_radiance_w_m2_sr ? scene.ambient_radiance_w_m2_sr(x, s) : 0);
    SensorPoint point{x * 0.05, s * 0.05};
    if (scene.image_mapping) point = scene.image_mapping(point);
    n.push_back(point.u_m);
    n.push_back(point.v_m);
  }
  return n;
}

std::vector<double> Numbers(const OpticsModel& optics) {
  std::vector<double> n = {optics.field_dependent ? 1.0 : 0.0, optics.image_distance_m,
                           optics.wavelength_m, optics.reference_pupil_radius_m};
  for (const double u : {-2e-3, 0.0, 1e-3, 4e-3}) {
    for (const double v : {-1e-3, 0.0, 2e-3}) {
      const Pupil pupil = optics.pupil(u, v);
      n.push_back(pupil.radius_m);
      for (const double r : {0.3, 0.9}) {
        for (const double phi : {0.2, 1.9, 4.0}) {
          const double x = r * pupil.radius_m * std::cos(phi);
          const double y = r * pupil.radius_m * std::sin(phi);
          n.push_back(1e6 * pupil.WavefrontError(x, y));
          n.push_back(pupil.Transmission(x, y));
        }
      }
      n.push_back(optics.curvature(0.3, u, v));
      for (const TransferFunction& transfer : optics.transfer) {
        const std::complex<double> t = transfer(1e7 * u, 1e7 * v);
        n.push_back(t.real() - 1);
        n.push_back(t.imag());
      }
    }
  }
  return n;
}

std::vector<double> Numbers(const SpeckleModel& speckle) {
  std::vector<double> n = {speckle.on ? 1.0 : 0.0};
  double square = 0, sum = 0;
  for (const double weight : speckle.pattern_weights) {
    square += weight * weight;
    sum += weight;
  }
  n.push_back(square);
  n.push_back(sum);
  n.push_back(speckle.shifts.front().u_m);
  n.push_back(speckle.shifts.back().u_m);
  return n;
}

std::vector<double> Numbers(const PixelIrradiance& light) {
  std::vector<double> n(light.laser_irradiance_w_m2.values.begin(),
                        light.laser_irradiance_w_m2.values.end());
  for (const Image<float>& flux : light.incoherent_electron_flux_m2_s) {
    for (const float value : flux.values) n.push_back(1e-10 * value);
  }
  return n;
}

// Outputs of all hooks for the same random data, each hook's output apart.
std::vector<std::vector<double>> Outputs(const Effect& effect, const std::vector<double>& p,
                                         bool apply) {
  std::vector<std::vector<double>> outputs;
  FrameSetup frame = TestFrame();
  const FrameSetup nominal = frame;
  if (apply) effect.OnFrame(frame, p);
  outputs.push_back(Numbers(frame));
  PlateScene scene = TestScene(nominal);
  if (apply) effect.OnPlate(scene, nominal, p);
  outputs.push_back(Numbers(scene));
  OpticsModel optics = TestOptics(nominal);
  if (apply) effect.OnOptics(optics, nominal, p);
  outputs.push_back(Numbers(optics));
  SpeckleModel speckle;
  speckle.pattern_weights = {0.7, 0.3};
  if (apply) effect.OnSpeckle(speckle, nominal, p);
  outputs.push_back(Numbers(speckle));
  PixelIrradiance light = RandomLight(nominal, 5);
  if (apply) effect.OnPixelIrradiance(light, nominal, p);
  outputs.push_back(Numbers(light));
  const Image<double> previous = RandomElectrons(nominal, 6, 12000);
  Image<double> electrons = RandomElectrons(nominal, 7, 12000);
  if (apply) effect.OnMeanElectrons(electrons, &previous, nominal, p);
  outputs.push_back(electrons.values);
  electrons = RandomElectrons(nominal, 8, 9000);
  if (apply) effect.OnElectrons(electrons, nominal, p);
  outputs.push_back(electrons.values);
  Image<uint16_t> raw(40, 25);
  for (size_t i = 0; i < raw.values.size(); ++i) raw.values[i] = static_cast<uint16_t>(i + 24);
  if (apply) effect.OnRaw(raw, nominal, p);
  outputs.emplace_back(raw.values.begin(), raw.values.end());
  IdealImage ideal;
  ideal.grid = {nominal.roi, 2, 3, nominal.sensor.pixel_pitch_m};
  ideal.laser_irradiance_w_m2 = Image<float>(ideal.grid.columns(), ideal.grid.rows(), 0.37F);
  if (apply) effect.OnIdealImage(ideal, nominal, p);
  outputs.emplace_back(ideal.laser_irradiance_w_m2.values.begin(),
                       ideal.laser_irradiance_w_m2.values.end());
  return outputs;
}

std::vector<double> NullParameters(const Effect& effect) {
  std::vector<double> p;
  for (const EffectParameter& parameter : effect.description().parameters) {
    p.push_back(parameter.null_value);
  }
  return p;
}

TEST(Effects, NullIsBitIdentical) {
  for (const Effect* effect : AllEffects()) {
    EXPECT_EQ(Outputs(*effect, NullParameters(*effect), true), Outputs(*effect, {}, false))
        << effect->description().id;
  }
}

// Root mean square change of each hook's output over its own size, the largest of the hooks.
double Change(const std::vector<std::vector<double>>& a,
              const std::vector<std::vector<double>>& b) {
  double largest = 0;
  for (size_t hook = 0; hook < a.size(); ++hook) {
    if (a[hook].size() != b[hook].size()) return std::numeric_limits<double>::infinity();
    double change = 0, size = 0;
    for (size_t i = 0; i < a[hook].size(); ++i) {
      change += std::pow(a[hook][i] - b[hook][i], 2);
      size += b[hook][i] * b[hook][i];
    }
    largest = std::max(largest, std::sqrt(change / std::max(size, 1e-300)));
  }
  return largest;
}

// First parameter of every effect is its dial. Rounded dials and the one effect that cannot be seen
// by itself are listed.
bool HasContinuousDial(std::string_view id) {
  return id != "optics.polygon_aperture" && id != "sensor.adc_missing_bits" &&
         id != "sensor.rolling_shutter";
}

TEST(Effects, SmallDialSmallChangeLargeDialLargerChange) {
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    if (!HasContinuousDial(description.id)) continue;
    const EffectParameter& dial = description.parameters[0];
    const bool up = dial.upper > dial.null_value;
    const double room = up ? dial.upper - dial.null_value : dial.lower - dial.null_value;
    // Rare spots and pixels: only many of them are sure to lie in the small test region.
    const bool rare = description.id == "optics.dust" || description.id == "sensor.hot_pixels";
    const double full =
        rare ? room : std::copysign(std::min(2 * dial.prior_scale, std::abs(room)), room);
    const auto before = Outputs(*effect, NullParameters(*effect), true);
    const auto change = [&](double share) {
      std::vector<double> p = NullParameters(*effect);
      p[0] = dial.null_value + share * full;
      const auto after = Outputs(*effect, p, true);
      // Lists that grew by an element, and fields that vary: compare with the same structure.
      std::vector<double> tiny = NullParameters(*effect);
      tiny[0] = dial.null_value + 1e-9 * full;
      return std::min(Change(after, before), Change(after, Outputs(*effect, tiny, true)));
    };
    const double large = change(1);
    const double small = change(1e-3);
    EXPECT_GT(large, 0) << description.id;
    // Full well and rim do nothing until they are smaller than what is there; a hot pixel or a
    // speckle mode comes as a whole, its share being small.
    EXPECT_LE(small, 0.2 * large) << description.id << " " << small << " " << large;
  }
}

TEST(Effects, PureAndRepeatable) {
  for (const Effect* effect : AllEffects()) {
    std::vector<double> p = NullParameters(*effect);
    const EffectParameter& dial = effect->description().parameters[0];
    p[0] = dial.upper > dial.null_value
               ? dial.null_value + 0.3 * std::min(dial.prior_scale, dial.upper - dial.null_value)
               : 0.5 * (dial.lower + dial.null_value);
    EXPECT_EQ(Outputs(*effect, p, true), Outputs(*effect, p, true)) << effect->description().id;
  }
}

}  // namespace
}  // namespace sightline
