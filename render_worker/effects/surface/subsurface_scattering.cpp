// SPDX-License-Identifier: Apache-2.0
// Light that enters the surface and leaves it at another point: across the line a fraction f
// spreads as exp(-|s|/l)/(2 l), the rest stays.
#include <algorithm>
#include <cmath>
#include <memory>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/plate_profile.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class SubsurfaceScatteringEffect final : public DescribedEffect {
 public:
  SubsurfaceScatteringEffect()
      : DescribedEffect(
            {.id = "surface.subsurface_scattering",
             .stage = Stage::kSurface,
             .signature = {{"line_flanks", "background"}, {"camera_distance_m", "signal_level"}},
             .scope = EffectScope::kFlatPlate,
             .summary = "part f of the light spreads as exp(-|s|/l)/(2 l)",
             .reference = "Jensen et al., A practical model for subsurface light "
                          "transport, SIGGRAPH 2001",
             .parameters = {{"scattered_fraction", 0, 0, 1, 0.2},
                            {"spread_m", 3e-4, 1e-5, 1e-2, 3e-4}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the table is costly
    const double line_m = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                          std::cos(frame.plate.incidence_angle_rad);
    auto spread = std::make_shared<PlateProfile>(
        scene.laser_irradiance_w_m2, frame, scene.constant_along_line, std::min(line_m, 2 * p[1]));
    spread->SpreadExponentially(p[1]);
    scene.laser_irradiance_w_m2 = [fraction = p[0], spread,
                                   before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                    double s_m) {
      return (1 - fraction) * before(x_m, s_m) + fraction * spread->At(x_m, s_m);
    };
  }
};

}  // namespace

const Effect& SubsurfaceScattering() {
  static const SubsurfaceScatteringEffect effect;
  return effect;
}

}  // namespace sightline
