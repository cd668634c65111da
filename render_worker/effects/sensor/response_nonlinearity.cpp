// SPDX-License-Identifier: Apache-2.0
// Response that bends: e (1 - beta e/e_full), e_full = (2^bits - 1)/K. Beyond its largest value, at
// e_full/(2 beta), it stays constant.
#include <algorithm>
#include <cmath>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class ResponseNonlinearityEffect final : public DescribedEffect {
 public:
  ResponseNonlinearityEffect()
      : DescribedEffect({.id = "sensor.response_nonlinearity",
                         .stage = Stage::kSensor,
                         .signature = {{"line_core"}, {"signal_level", "exposure_time_s"}},
                         .summary = "charge e reads as e (1 - beta e/e_full)",
                         .reference = "EMVA 1288 R4.0 Linear, linearity error LE",
                         .parameters = {{"nonlinearity", 0, -0.5, 0.5, 0.05}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const double full = frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
    const double per_electron = p[0] / full;
    const double vertex = per_electron > 0 ? 0.5 / per_electron : INFINITY;
    for (double& e : electrons.values) {
      const double bent = std::min(e, vertex);
      e = bent * (1 - per_electron * bent);
    }
  }
};

}  // namespace

const Effect& ResponseNonlinearity() {
  static const ResponseNonlinearityEffect effect;
  return effect;
}

}  // namespace sightline
