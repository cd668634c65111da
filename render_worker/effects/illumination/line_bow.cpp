// SPDX-License-Identifier: Apache-2.0
// Curved line: at the ends of the fan (X = L/2) it lies `bow` off its place in the middle.
#include <cmath>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class LineBowEffect final : public DescribedEffect {
 public:
  LineBowEffect()
      : DescribedEffect(
            {.id = "illumination.line_bow",
             .stage = Stage::kIllumination,
             .signature = {{"line_position", "along_line"}, {"column", "camera_distance_m"}},
             .scope = EffectScope::kFlatPlate,
             .summary = "line curved: s = s0 + bow (X/(L/2))^2 on the plate",
             .reference = "Powell, US patent 4826299 (1989); thesis 5.3.1, laser lines",
             .parameters = {{"bow_m", 0, -0.02, 0.02, 1e-3}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the line stays constant along X
    const double half_length =
        frame.plate.laser_distance_m * std::tan(frame.laser.fan_angle_rad / 2);
    const double per_m2 = p[0] / (half_length * half_length);
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      return before(x_m, s_m - per_m2 * x_m * x_m);
    };
  }
};

}  // namespace

const Effect& LineBow() {
  static const LineBowEffect effect;
  return effect;
}

}  // namespace sightline
