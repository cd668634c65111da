// SPDX-License-Identifier: Apache-2.0
// A cooler that switches on and off makes the sensor's temperature, and with it the black level,
// swing: mean dark signal + a cos(2 pi t/period + phase). EMVA 1288 R4.0 Linear, section 3
// (dark current and temperature).
#include <cmath>
#include <numbers>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class CoolerCycleLaw final : public DescribedEffect {
 public:
  CoolerCycleLaw()
      : DescribedEffect(
            {.id = "outside.cooler_cycle",
             .stage = Stage::kTime,
             .signature = {{"dark_frames", "background"}, {"timestamp_s"}},
             .summary = "dark signal swings periodically with the cooler",
             .reference =
                 "EMVA 1288 R4.0 Linear, section 3 (dark current and temperature); general "
                 "knowledge: coolers that switch on and off",
             .parameters = {{"swing_electrons", 0, 0, 1000, 3},
                            {"period_s", 80, 1, 1e4, 60},
                            {"phase_deg", 0, -360, 360, 180}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double turns = frame.timestamp_s / p[1] + p[2] / 360;
    frame.sensor.dark_mean_electrons += p[0] * std::cos(2 * std::numbers::pi * turns);
  }
};

}  // namespace

OutsideLaw CoolerCycle() {
  static const CoolerCycleLaw law;
  return {&law, "time", {{"period_s", 40, 150}, {"phase_deg", -180, 180, false}}};
}

}  // namespace sightline::bench
