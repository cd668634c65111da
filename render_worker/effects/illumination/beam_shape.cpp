// SPDX-License-Identifier: Apache-2.0
// Profile across the line that is not Gaussian: exp(-2 |x/w|^n) of the same power.
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class BeamShapeEffect final : public DescribedEffect {
 public:
  BeamShapeEffect()
      : DescribedEffect(
            {.id = "illumination.beam_shape",
             .stage = Stage::kIllumination,
             .signature = {{"line_core", "line_flanks"}, {"laser_distance_m"}},
             .scope = EffectScope::kFlatPlate,
             .summary = "profile exp(-2 |x/w|^n) instead of n = 2, power and w as before",
             .reference = "Parent, Morin and Lavigne, Opt. Quantum Electron. 24 (1992) "
                          "S1071 (super-Gaussian beams)",
             .parameters = {{"shape_exponent", 2, 1, 10, 0.5}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    const double exponent = p[0];
    if (exponent == 2) return;  // pow(r, 1) r would round
    const double radius = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                          std::cos(frame.plate.incidence_angle_rad);
    const double centre = frame.plate.line_offset_m;
    // Integral of exp(-2 |t|^n) is 2^(1 - 1/n) Gamma(1 + 1/n).
    const double power = std::sqrt(std::numbers::pi / 2) /
                         (std::exp2(1 - 1 / exponent) * std::tgamma(1 + 1 / exponent));
    // The Gaussian is looked up where it has the wanted value, (x'/w)^2 = |x/w|^n.
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      const double t = (s_m - centre) / radius;
      const double looked_up = std::copysign(std::pow(std::abs(t), 0.5 * exponent), t);
      return power * before(x_m, centre + radius * looked_up);
    };
  }
};

}  // namespace

const Effect& BeamShape() {
  static const BeamShapeEffect effect;
  return effect;
}

}  // namespace sightline
