// SPDX-License-Identifier: Apache-2.0
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/independent_patterns.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class PartialCoherenceEffect final : public DescribedEffect {
 public:
  PartialCoherenceEffect()
      : DescribedEffect({.id = "illumination.partial_coherence",
                         .stage = Stage::kIllumination,
                         .signature = {.regions = {"speckle"}},
                         .summary = "M modes of equal power make M independent patterns: contrast "
                                    "1/sqrt(M)",
                         .reference = "Goodman, Speckle Phenomena in Optics, 2nd ed., section 3.3",
                         .parameters = {{"modes", 1, 1, 64, 1}}}) {}

  void OnSpeckle(SpeckleModel& speckle, const FrameSetup&, Parameters p) const override {
    speckle.pattern_weights = SplitPatterns(speckle.pattern_weights, EqualModes(p[0]));
  }
};

}  // namespace

const Effect& PartialCoherence() {
  static const PartialCoherenceEffect effect;
  return effect;
}

}  // namespace sightline
