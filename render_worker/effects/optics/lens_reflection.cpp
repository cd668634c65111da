// Two reflections, between cover glass and sensor or at a plane filter: a sharp copy of the image,
// displaced the same everywhere. Copy and image share the light.
#include <cmath>
#include <numbers>

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
                         .parameters = {{"reflection_relative", 0, 0, 0.5, 0.02},
                                        {"displacement_v_m",
                                         1e-4,
                                         -1e-3,
                                         1e-3,
                                         1e-4,
                                         {-2.5e-4, -1e-4, -4e-5, 4e-5, 2.5e-4}},
                                        {"displacement_u_m", 0, -1e-3, 1e-3, 1e-4}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;  // the list of transfer functions stays as it is
    optics.transfer.push_back([strength = p[0], dv = p[1], du = p[2]](double qx, double qy) {
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
