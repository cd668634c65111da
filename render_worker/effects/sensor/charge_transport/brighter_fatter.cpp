// SPDX-License-Identifier: Apache-2.0
// Charge collected repels charge to come: pixel boundaries move towards the fuller pixel, and
// between two neighbours flows a q_mean (q_i - q_j)/2, q_mean = (q_i + q_j)/2. It acts on the
// charge that has come, noise included: that is why the variance of flat fields bends below the
// mean.
#include "render_worker/effects/charge_flow.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class BrighterFatterEffect final : public DescribedEffect {
 public:
  BrighterFatterEffect()
      : DescribedEffect({.id = "sensor.brighter_fatter",
                         .stage = Stage::kSensor,
                         .signature = {{"line_core", "speckle"}, {"signal_level"}},
                         .charge_transport = ChargeTransport::kGrowsWithCharge,
                         .summary = "flow a q_mean (q_i - q_j)/2 between neighbours",
                         .reference = "Antilogus et al., JINST 9 (2014) C03048",
                         .parameters = {{"boundary_shift_per_electron", 0, 0, 1e-5, 5e-7}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup&, Parameters p) const override {
    MoveCharge(electrons, [quarter = 0.25 * p[0]](double from, double to) {
      return quarter * (from + to) * (from - to);
    });
  }
};

}  // namespace

const Effect& BrighterFatter() {
  static const BrighterFatterEffect effect;
  return effect;
}

}  // namespace sightline
