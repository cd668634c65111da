// SPDX-License-Identifier: Apache-2.0
// Multiple scattering leaves light of degree of polarisation P: two independent patterns with the
// shares (1 + P)/2 and (1 - P)/2, contrast sqrt((1 + P^2)/2).
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/independent_patterns.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class DepolarisationEffect final : public DescribedEffect {
 public:
  DepolarisationEffect()
      : DescribedEffect({.id = "surface.depolarisation",
                         .stage = Stage::kSurface,
                         .signature = {.regions = {"speckle"}},
                         .summary = "speckle partly polarised: patterns with the shares (1 +- P)/2",
                         .reference = "Goodman, Speckle Phenomena in Optics, 2nd ed., section 3.4",
                         .parameters = {{"degree_of_polarisation", 1, 0, 1, 0.5}}}) {}

  void OnSpeckle(SpeckleModel& speckle, const FrameSetup&, Parameters p) const override {
    speckle.pattern_weights =
        SplitPatterns(speckle.pattern_weights, {0.5 * (1 + p[0]), 0.5 * (1 - p[0])});
  }
};

}  // namespace

const Effect& Depolarisation() {
  static const DepolarisationEffect effect;
  return effect;
}

}  // namespace sightline
