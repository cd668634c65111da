// SPDX-License-Identifier: Apache-2.0
// A stage that has just moved still swings and settles: frame i of a burst, 0.2 s after the one
// before, is blurred by a sinusoidal movement of amplitude A exp(-0.2 s i/tau), whose transfer
// function is J_0(2 pi q A). Single shots are blurred most. Singer and Seering, Preshaping
// command inputs to reduce system vibration, ASME J. Dyn. Syst. Meas. Control 112 (1990) 76;
// Hadar, Fisher and Kopeika, Image resolution limits resulting from mechanical vibrations III, Opt.
// Eng. 31 (1992) 581.
#include <cmath>
#include <complex>
#include <numbers>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class StageSettlingLaw final : public DescribedEffect {
 public:
  StageSettlingLaw()
      : DescribedEffect(
            {.id = "outside.stage_settling",
             .stage = Stage::kTime,
             .signature = {{"line_flanks", "speckle"}, {"burst_frame_index"}},
             .summary = "blur by a swing that decays within a burst, J_0(2 pi q A exp(-t/tau))",
             .reference = "Singer and Seering, ASME J. Dyn. Syst. Meas. Control 112 (1990) 76; "
                          "Hadar, Fisher and Kopeika, Opt. Eng. 31 (1992) 581",
             .parameters = {{"swing_m", 0, 0, 2e-4, 3e-6}, {"decay_time_s", 0.2, 0.01, 10, 0.2}}}) {
  }

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double swing = p[0] * std::exp(-0.2 * frame.burst_frame_index / p[1]);
    optics.transfer.push_back([swing](double /*qx*/, double qy) {
      const double x = 2 * std::numbers::pi * swing * std::abs(qy);
      return std::complex<double>(std::cyl_bessel_j(0.0, x));
    });
  }
};

}  // namespace

OutsideLaw StageSettling() {
  static const StageSettlingLaw law;
  return {&law, "time", {{"decay_time_s", 0.08, 0.4}}, true};
}

}  // namespace sightline::bench
