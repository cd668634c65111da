// SPDX-License-Identifier: Apache-2.0
// Photo-electrons that diffuse into each of the four neighbours, a fraction c each. It acts on the
// means: electrons move independently, so the pixels' numbers stay independent Poisson numbers.
#include "render_worker/effects/charge_flow.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class CrosstalkEffect final : public DescribedEffect {
 public:
  CrosstalkEffect()
      : DescribedEffect(
            {.id = "sensor.crosstalk",
             .stage = Stage::kSensor,
             .signature = {{"line_core", "speckle", "line_flanks"}, {"signal_level"}},
             .charge_transport = ChargeTransport::kProportional,
             .summary = "part c of the charge goes to each of four neighbours",
             .reference = "Janesick, Photon Transfer (2007), chapter 3 (charge diffusion)",
             .parameters = {{"crosstalk_fraction", 0, 0, 0.2, 0.02}}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>* /*previous*/,
                       const FrameSetup&, Parameters p) const override {
    MoveCharge(electrons, [c = p[0]](double from, double to) { return c * (from - to); });
  }
};

}  // namespace

const Effect& Crosstalk() {
  static const CrosstalkEffect effect;
  return effect;
}

}  // namespace sightline
