// SPDX-License-Identifier: Apache-2.0
// A micro-lens focuses a narrow cone of light onto the photodiode of its pixel. The rim of a wider
// cone is lost on the metal around it, so that at low f-numbers the signal grows more slowly than
// 1/N^2. Half of the light is accepted at N = N_c; the order p says how sharp the limit is. Blur
// and speckle stay those of the lens, because the light is lost behind the image plane.
#include <cmath>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class MicroLensVignettingEffect final : public DescribedEffect {
 public:
  MicroLensVignettingEffect()
      : DescribedEffect(
            {.id = "sensor.micro_lens_vignetting",
             .stage = Stage::kSensor,
             .signature = {{"line_core", "whole_image"}, {"f_number"}},
             .summary = "accepted share of the light 1 / (1 + (N_c / N)^p), N the f-number, N_c "
                        "that of the cone of which half is accepted",
             .reference = "Catrysse and Wandell, J. Opt. Soc. Am. A 19 (2002) 1610 (geometrical "
                          "limit of a pixel's acceptance)",
             .parameters = {{"acceptance_f_number", 0, 0, 16, 0.7},
                            {"roll_off_order", 4, 1, 12, 2}}}) {}

  // All light passes the micro-lenses, the dark signal does not.
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double accepted = 1 / (1 + std::pow(p[0] / frame.lens.f_number, p[1]));
    for (QuantumEfficiencyCurve& curve : frame.sensor.quantum_efficiency) {
      for (double& efficiency : curve.quantum_efficiency) efficiency *= accepted;
    }
  }
};

}  // namespace

const Effect& MicroLensVignetting() {
  static const MicroLensVignettingEffect effect;
  return effect;
}

}  // namespace sightline
