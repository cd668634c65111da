// SPDX-License-Identifier: Apache-2.0
// Analogue-to-digital converter: lowest bits stuck at 0, integral nonlinearity. The nonlinearity
// A sin(2 pi c y/y_max) is added before rounding, where it varies continuously with A.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr const char* kConverterReference = "IEEE 1241-2010 (analog-to-digital converters)";

class AdcMissingBitsEffect final : public DescribedEffect {
 public:
  AdcMissingBitsEffect()
      : DescribedEffect({.id = "sensor.adc_missing_bits",
                         .stage = Stage::kSensor,
                         .signature = {{"histogram", "whole_image"}, {"signal_level"}},
                         .summary = "lowest bits stuck at 0, so that numbers are cut",
                         .reference = kConverterReference,
                         .parameters = {{.name = "missing_bits",
                                         .null_value = 0,
                                         .lower = 0,
                                         .upper = 8,
                                         .prior_scale = 1,
                                         .discrete_values = {1, 2, 3, 4}}}}) {}

  void OnRaw(Image<uint16_t>& raw, const FrameSetup&, Parameters p) const override {
    const auto mask = static_cast<uint16_t>(0xffffU << std::lround(p[0]));
    for (uint16_t& dn : raw.values) dn = static_cast<uint16_t>(dn & mask);
  }
};

class AdcInlEffect final : public DescribedEffect {
 public:
  AdcInlEffect()
      : DescribedEffect({.id = "sensor.adc_inl",
                         .stage = Stage::kSensor,
                         .signature = {{"histogram", "line_core"}, {"signal_level"}},
                         .summary = "y + A sin(2 pi c y/y_max)",
                         .reference = kConverterReference,
                         .parameters = {{"inl_amplitude_dn", 0, -100, 100, 2},
                                        // A wave is found from less than half a cycle off only.
                                        {"inl_cycles",
                                         1,
                                         0.25,
                                         64,
                                         2,
                                         {0.5, 1.7, 2.4, 3.1, 3.8, 4.5, 5.2, 6, 7, 8, 10, 12}}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const Sensor& sensor = frame.sensor;
    const double turn = 2 * std::numbers::pi * p[1] / sensor.largest_dn();
    for (double& e : electrons.values) {
      const double dn = sensor.gain_dn_per_electron * e + sensor.black_level_dn;
      e += p[0] * std::sin(turn * std::clamp(dn, 0.0, sensor.largest_dn())) /
           sensor.gain_dn_per_electron;
    }
  }
};

}  // namespace

const Effect& AdcMissingBits() {
  static const AdcMissingBitsEffect effect;
  return effect;
}
const Effect& AdcInl() {
  static const AdcInlEffect effect;
  return effect;
}

}  // namespace sightline
