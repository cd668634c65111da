// SPDX-License-Identifier: Apache-2.0
// Powell lens that spreads the light unevenly: a slope along the line and a ripple in fan angle.
// The place on the line is X/(L/2), 1 at its end, L = 2 d tan(fan/2).
#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class LineNonuniformityEffect final : public DescribedEffect {
 public:
  LineNonuniformityEffect()
      : DescribedEffect(
            {.id = "illumination.line_nonuniformity",
             .stage = Stage::kIllumination,
             .signature = {{"along_line"}, {"column", "field_position"}},
             .scope = EffectScope::kFlatPlate,
             .summary =
                 "irradiance times 1 + slope X/(L/2) + ripple cos(2 pi angle/period + phase)",
             .reference = "Powell, US patent 4826299 (1989); thesis 5.3.1, laser lines",
             .parameters = {{"slope_relative", 0, -1, 1, 0.1},
                            {"ripple_relative", 0, 0, 0.9, 0.05},
                            {"ripple_period_deg", 2, 0.05, 90, 2, {0.7, 1.2, 4, 8}},
                            {"ripple_phase_deg", 0, -360, 360, 180, {-90, 90, 180}}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    const double slope = p[0], ripple = p[1];
    if (slope == 0 && ripple == 0) return;  // the line stays constant along X
    const double distance = frame.plate.laser_distance_m;
    const double half_length = distance * std::tan(frame.laser.fan_angle_rad / 2);
    const double turns_per_rad = 180 / p[2] * 2;  // 2 pi/period, in radians of angle
    const double phase = p[3] * std::numbers::pi / 180;
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      const double factor = 1 + slope * x_m / half_length +
                            ripple * std::cos(turns_per_rad * std::atan(x_m / distance) + phase);
      return std::max(0.0, factor) * before(x_m, s_m);
    };
  }
};

}  // namespace

const Effect& LineNonuniformity() {
  static const LineNonuniformityEffect effect;
  return effect;
}

}  // namespace sightline
