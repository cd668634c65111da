// SPDX-License-Identifier: Apache-2.0
// Light bleaches a dye at the place that it strikes: after i exposures of one place its
// reflectance is 1/(1 + a i) of what it was, kinetics of second order. A new place on the plate
// starts at its full reflectance. Song et al., Photobleaching kinetics of
// fluorescein in quantitative fluorescence microscopy, Biophysical Journal 68 (1995) 2588, find
// bleaching that is no exponential.
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class BleachingLaw final : public DescribedEffect {
 public:
  BleachingLaw()
      : DescribedEffect({.id = "outside.bleaching",
                         .stage = Stage::kSurface,
                         .signature = {{"line_core", "whole_image"}, {"burst_frame_index"}},
                         .summary = "reflectance 1/(1 + a i) after i exposures of the same place",
                         .reference =
                             "Song et al., Biophysical Journal 68 (1995) 2588; general knowledge: "
                             "kinetics of second order",
                         .parameters = {{"loss_per_exposure", 0, 0, 2, 0.02}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0 || frame.burst_frame_index == 0) return;
    scene.brdf_per_sr = [left = 1 / (1 + p[0] * frame.burst_frame_index),
                         before = std::move(scene.brdf_per_sr)](double x_m, double s_m) {
      return left * before(x_m, s_m);
    };
  }
};

}  // namespace

OutsideLaw Bleaching() {
  static const BleachingLaw law;
  return {&law, "plate", {}};
}

}  // namespace sightline::bench
