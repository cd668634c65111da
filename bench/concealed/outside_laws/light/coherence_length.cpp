// SPDX-License-Identifier: Apache-2.0
// Speckle of a laser of coherence length L: under oblique incidence theta, paths differ over the
// lens's resolution cell lambda N d/f on the plate by D = lambda N d sin(theta)/f, and contrast
// falls as the number of patterns M = sqrt(1 + (D/L)^2) grows. Parry, Some effects of temporal
// coherence on the first order statistics of speckle, Optica Acta 21 (1974) 763.
#include <algorithm>
#include <cmath>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/independent_patterns.h"

namespace sightline::bench {
namespace {

class CoherenceLengthLaw final : public DescribedEffect {
 public:
  CoherenceLengthLaw()
      : DescribedEffect({.id = "outside.coherence_length",
                         .stage = Stage::kIllumination,
                         .signature = {{"speckle"}, {"f_number", "camera_distance_m"}},
                         .summary = "speckle patterns M = sqrt(1 + (path difference in a "
                                    "resolution cell/coherence length)^2)",
                         .reference =
                             "Parry, Some effects of temporal coherence on the first order "
                             "statistics of speckle, Optica Acta 21 (1974) 763",
                         .parameters = {{"inverse_coherence_length_per_m", 0, 0, 1e6, 1000}}}) {}

  void OnSpeckle(SpeckleModel& speckle, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double cell_m = frame.laser.wavelength_m * frame.lens.f_number *
                          frame.plate.camera_distance_m / frame.lens.focal_length_m;
    const double paths = cell_m * std::sin(frame.plate.incidence_angle_rad) * p[0];
    const double modes = std::min(64.0, std::sqrt(1 + paths * paths));
    speckle.pattern_weights = SplitPatterns(speckle.pattern_weights, EqualModes(modes));
  }
};

}  // namespace

OutsideLaw CoherenceLength() {
  static const CoherenceLengthLaw law;
  return {&law, "source", {}, true};
}

}  // namespace sightline::bench
