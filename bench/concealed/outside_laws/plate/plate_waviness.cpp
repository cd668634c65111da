// SPDX-License-Identifier: Apache-2.0
// A rolled or milled plate is wavy: height A sin(2 pi X/L + phase) moves the inclined sheet's
// line by height times tan(incidence), and the distance from the camera. ISO 21920-2:2021
// (waviness profile).
#include <cmath>
#include <numbers>
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class PlateWavinessLaw final : public DescribedEffect {
 public:
  PlateWavinessLaw()
      : DescribedEffect(
            {.id = "outside.plate_waviness",
             .stage = Stage::kSurface,
             .signature = {{"line_position", "along_line"}, {"column", "camera_distance_m"}},
             .summary = "height A sin(2 pi X/L + phase) of a wavy plate",
             .reference = "ISO 21920-2:2021 (waviness profile)",
             .parameters = {{"wave_height_m", 0, 0, 5e-3, 2e-5},
                            {"wave_length_m", 0.02, 1e-3, 1, 0.02},
                            {"wave_phase_deg", 0, -360, 360, 180}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double tangent = std::tan(frame.plate.incidence_angle_rad);
    const auto rise_m = [height = p[0], turn = 2 * std::numbers::pi / p[1],
                         phase = p[2] * std::numbers::pi / 180](double x_m) {
      return height * std::sin(turn * x_m + phase);
    };
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      return before(x_m, s_m - rise_m(x_m) * tangent);
    };
    scene.height_m = [=, before = std::move(scene.height_m)](double x_m, double s_m) {
      return (before ? before(x_m, s_m) : 0.0) + rise_m(x_m);
    };
  }
};

}  // namespace

OutsideLaw PlateWaviness() {
  static const PlateWavinessLaw law;
  return {&law, "plate", {{"wave_length_m", 0.012, 0.05}, {"wave_phase_deg", -180, 180, false}}};
}

}  // namespace sightline::bench
