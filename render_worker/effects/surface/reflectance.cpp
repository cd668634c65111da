// SPDX-License-Identifier: Apache-2.0
// Reflectance: amount and lobe.
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class AlbedoErrorEffect final : public DescribedEffect {
 public:
  AlbedoErrorEffect()
      : DescribedEffect(
            {.id = "surface.albedo_error",
             .stage = Stage::kSurface,
             .signature = {{"line_core", "whole_image"}, {"signal_level"}},
             .scope = EffectScope::kFlatPlate,
             .inspection_fields = {{.field = "materials.material.lambert_ggx.diffuse_albedo"},
                                   {.field = "materials.material.lambert_ggx.specular_f0"}},
             .summary = "reflectance (f_r as a whole) times a factor",
             .reference = "thesis eq. 4.7 (BRDF)",
             .parameters = {{"amplitude_factor", 1, 0.1, 10, 0.2}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup&, Parameters p) const override {
    scene.brdf_per_sr = [factor = p[0], before = std::move(scene.brdf_per_sr)](
                            double x_m, double s_m) { return factor * before(x_m, s_m); };
  }
};

class BrdfErrorEffect final : public DescribedEffect {
 public:
  BrdfErrorEffect()
      : DescribedEffect(
            {.id = "surface.brdf_error",
             .stage = Stage::kSurface,
             .signature = {{"line_core", "whole_image"}, {"signal_level"}},
             .scope = EffectScope::kFlatPlate,
             .inspection_fields = {{.field = "materials.material.lambert_ggx.ggx_alpha"}},
             .summary = "width of the lobe not as stated: GGX alpha times a factor",
             .reference = "Walter et al., EGSR 2007, eq. 33",
             .parameters = {{"alpha_factor", 1, 0.2, 5, 0.2}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override { frame.surface.ggx_alpha *= p[0]; }
};

}  // namespace

const Effect& AlbedoError() {
  static const AlbedoErrorEffect effect;
  return effect;
}
const Effect& BrdfError() {
  static const BrdfErrorEffect effect;
  return effect;
}

}  // namespace sightline
