// SPDX-License-Identifier: Apache-2.0
// Second, weaker line by double reflection in the projector's window or lens: the same profile, off
// by a fixed angle, so the offset across the beam grows with distance; stated at 0.4 m. Both lines
// share the laser's power.
#include <cmath>
#include <vector>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// A copy of a narrow line is found from within its width only.
std::vector<double> OffsetStarts() {
  std::vector<double> starts;
  for (double mm : {0.6, 0.9, 1.3, 1.7, 2.3, 3.0, 4.0, 5.5, 8.0, 12.0}) {
    starts.insert(starts.end(), {-1e-3 * mm, 1e-3 * mm});
  }
  return starts;
}

class GhostLineEffect final : public DescribedEffect {
 public:
  GhostLineEffect()
      : DescribedEffect(
            {.id = "illumination.ghost_line",
             .stage = Stage::kIllumination,
             .signature = {{"line_flanks", "background"},
                           {"laser_distance_m", "camera_distance_m"}},
             .scope = EffectScope::kFlatPlate,
             .summary = "second line of relative strength g: (E(s) + g E(s - offset))/(1 + g)",
             .reference = "Hecht, Optics, 5th ed., section 9.4 (reflections of a wedged plate)",
             .parameters = {{"ghost_relative", 0, 0, 1, 0.05},
                            {"ghost_offset_m", 2e-3, -0.05, 0.05, 2e-3, OffsetStarts()}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    constexpr double kStatedDistance_m = 0.4;
    const double strength = p[0];
    const double offset = p[1] * (frame.plate.laser_distance_m / kStatedDistance_m) /
                          std::cos(frame.plate.incidence_angle_rad);
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      return (before(x_m, s_m) + strength * before(x_m, s_m - offset)) / (1 + strength);
    };
  }
};

}  // namespace

const Effect& GhostLine() {
  static const GhostLineEffect effect;
  return effect;
}

}  // namespace sightline
