// SPDX-License-Identifier: Apache-2.0
// Two reflections, between cover glass and sensor or at a plane filter: a sharp copy of the image,
// displaced the same everywhere. Copy and image share the light.
#include <cmath>
#include <numbers>
#include <vector>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// A copy of a sharp line is found from within its width only.
std::vector<double> DisplacementStarts() {
  std::vector<double> starts;
  for (double um : {20, 40, 60, 80, 125, 150, 180, 210, 250, 300, 400, 550, 750}) {
    starts.insert(starts.end(), {-1e-6 * um, 1e-6 * um});
  }
  starts.push_back(-1e-4);
  return starts;
}

class LensReflectionEffect final : public DescribedEffect {
 public:
  LensReflectionEffect()
      : DescribedEffect(
            {.id = "optics.lens_reflection",
             .stage = Stage::kOptics,
             .signature = {{"background", "line_flanks"}, {"signal_level", "row"}},
             .summary = "displaced copy of the image, relative strength r: "
                        "(1 + r exp(-2 pi i q d))/(1 + r)",
             .reference = "ISO 9358:1994 (veiling glare of image-forming systems)",
             .parameters = {{"reflection_relative", 0, 0, 0.5, 0.02},
                            {"displacement_v_m", 1e-4, -1e-3, 1e-3, 1e-4, DisplacementStarts()},
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
