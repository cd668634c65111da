// SPDX-License-Identifier: Apache-2.0
// Light scattered by lenses and housing: a part g in a halo exp(-r/r0)/(2 pi r0^2), the rest stays.
// No light is lost. The halo's transform is (1 + (2 pi q r0)^2)^(-3/2).
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class VeilingGlareEffect final : public DescribedEffect {
 public:
  VeilingGlareEffect()
      : DescribedEffect({.id = "optics.veiling_glare",
                         .stage = Stage::kOptics,
                         .signature = {{"line_flanks", "background"}, {"signal_level"}},
                         .summary = "part g of the light in a halo exp(-r/r0)/(2 pi r0^2)",
                         .reference = "ISO 9358:1994 (veiling glare of image-forming systems)",
                         .parameters = {{"glare_fraction", 0, 0, 0.9, 0.05},
                                        {"halo_radius_m", 2e-4, 5e-6, 5e-3, 2e-4}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;  // the list of transfer functions stays as it is
    optics.transfer.push_back([glare = p[0], radius = p[1]](double qx, double qy) {
      const double x = 2 * std::numbers::pi * radius;
      const double square = 1 + x * x * (qx * qx + qy * qy);
      return std::complex<double>(1 - glare + glare / (square * std::sqrt(square)));
    });
  }
};

}  // namespace

const Effect& VeilingGlare() {
  static const VeilingGlareEffect effect;
  return effect;
}

}  // namespace sightline
