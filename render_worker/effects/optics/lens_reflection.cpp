// Two reflections, between cover glass and sensor or at a plane filter: a sharp copy of the image,
// displaced the same everywhere. Copy and image share the light. Displacement, 30 to 300 um in any
// direction, is drawn once a rig.
#include <cmath>
#include <numbers>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class LensReflectionEffect final : public DescribedEffect {
 public:
  LensReflectionEffect()
      : DescribedEffect({.id = "optics.lens_reflection",
                         .stage = Stage::kOptics,
                         .summary = "displaced copy of the image, relative strength r: "
                                    "(1 + r exp(-2 pi i q d))/(1 + r)",
                         .reference = "ISO 9358:1994 (veiling glare of image-forming systems)",
                         .parameters = {{"reflection_relative", 0, 0, 0.5, 0.02}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the list of transfer functions stays as it is
    CounterRandom random(DeriveSeed(frame.seeds.rig, "lens reflection"), 0);
    const double direction = 2 * std::numbers::pi * random.Uniform();
    const double length = 3e-5 * std::pow(10, random.Uniform());
    const double du = length * std::cos(direction), dv = length * std::sin(direction);
    optics.transfer.push_back([strength = p[0], du, dv](double qx, double qy) {
      const double phase = -2 * std::numbers::pi * (qx * du + qy * dv);
      return (1.0 + std::polar(strength, phase)) / (1 + strength);
    });
  }
};

}  // namespace

const Effect& LensReflection() {
  static const LensReflectionEffect effect;
  return effect;
}

}  // namespace sightline
