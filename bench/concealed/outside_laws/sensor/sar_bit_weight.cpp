// SPDX-License-Identifier: Apache-2.0
// The capacitor of one bit of a converter by successive approximation is off: raw numbers in
// which that bit is set read e DN more. The error jumps at every multiple of the bit's weight.
// Maloberti, Data Converters (2007), on successive approximation.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class SarBitWeightLaw final : public DescribedEffect {
 public:
  SarBitWeightLaw()
      : DescribedEffect({.id = "outside.sar_bit_weight",
                         .stage = Stage::kSensor,
                         .signature = {{"histogram", "line_core"}, {"signal_level"}},
                         .summary = "numbers with one of the upper bits set read e DN more",
                         .reference = "Maloberti, Data Converters (2007)",
                         .parameters = {{"weight_error_dn", 0, -100, 100, 2},
                                        {"bits_below_top", 2, 0, 6, 1}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const Sensor& sensor = frame.sensor;
    const int bit = sensor.bit_depth_bit - 1 - static_cast<int>(std::lround(p[1]));
    for (double& e : electrons.values) {
      const double dn = sensor.gain_dn_per_electron * e + sensor.black_level_dn;
      const auto code = static_cast<uint32_t>(std::lround(std::clamp(dn, 0., sensor.largest_dn())));
      if ((code >> bit & 1U) != 0) e += p[0] / sensor.gain_dn_per_electron;
    }
  }
};

}  // namespace

OutsideLaw SarBitWeight() {
  static const SarBitWeightLaw law;
  return {&law, "readout", {{"bits_below_top", 1, 4, false}}};
}

}  // namespace sightline::bench
