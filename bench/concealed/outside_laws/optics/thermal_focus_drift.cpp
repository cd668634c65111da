// SPDX-License-Identifier: Apache-2.0
// A lens that the camera warms changes its focal length and the place of the sensor: the distance
// in focus is d_foc (1 + a (1 - exp(-t/tau))). Yoder, Mounting Optics in Optical
// Instruments, 2nd ed. (2008), chapter 14 (effects of temperature changes); Zhou et al., Heat
// Transfer and Temperature Characteristics of a Working Digital Camera, Sensors 20 (2020) 2561.
#include <cmath>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class ThermalFocusDriftLaw final : public DescribedEffect {
 public:
  ThermalFocusDriftLaw()
      : DescribedEffect(
            {.id = "outside.thermal_focus_drift",
             .stage = Stage::kOptics,
             .signature = {{"line_flanks", "speckle"}, {"timestamp_s", "f_number"}},
             .summary = "focus distance d_foc (1 + a (1 - exp(-t/tau))) as the lens warms up",
             .reference =
                 "Yoder, Mounting Optics in Optical Instruments, 2nd ed. (2008), chapter 14; "
                 "Zhou et al., Sensors 20 (2020) 2561",
             .parameters = {{"focus_drift_relative", 0, -0.4, 1, 0.03},
                            {"warm_up_time_s", 500, 1, 1e5, 500}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double focus = frame.lens.focus_distance_m.value();
    frame.lens.focus_distance_m = focus * (1 + p[0] * (1 - std::exp(-frame.timestamp_s / p[1])));
  }
};

}  // namespace

OutsideLaw ThermalFocusDrift() {
  static const ThermalFocusDriftLaw law;
  return {&law, "pupil", {{"warm_up_time_s", 150, 1200}}};
}

}  // namespace sightline::bench
