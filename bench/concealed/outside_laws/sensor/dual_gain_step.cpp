// SPDX-License-Identifier: Apache-2.0
// Pixels with two conversion gains switch above a threshold; where the two are joined with a
// wrong ratio, charge above it reads by a factor 1 + a differently: a step of the response.
// Huggett et al., A dual-conversion-gain video sensor with dewarping and overlay on a single chip,
// ISSCC 2009.

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class DualGainStepLaw final : public DescribedEffect {
 public:
  DualGainStepLaw()
      : DescribedEffect(
            {.id = "outside.dual_gain_step",
             .stage = Stage::kSensor,
             .signature = {{"line_core", "histogram"}, {"signal_level", "exposure_time_s"}},
             .summary = "charge above a threshold reads as 1 + a of itself",
             .reference =
                 "Huggett et al., A dual-conversion-gain video sensor, ISSCC 2009; general "
                 "knowledge: the two gains are joined with an error",
             .parameters = {{"ratio_error", 0, -0.5, 0.5, 0.02},
                            {"threshold_relative", 0.3, 0.01, 0.99, 0.2}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double threshold = p[1] * frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
    for (double& e : electrons.values) {
      if (e > threshold) e *= 1 + p[0];
    }
  }
};

}  // namespace

OutsideLaw DualGainStep() {
  static const DualGainStepLaw law;
  return {&law, "electrons", {{"threshold_relative", 0.08, 0.4, false}}};
}

}  // namespace sightline::bench
