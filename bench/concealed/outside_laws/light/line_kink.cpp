// SPDX-License-Identifier: Apache-2.0
// The two faces of a roof prism or of joined cylinder lenses make two straight halves of the line
// with an angle between them: s = k |X - X_0|, X_0 = d tan(angle of the ridge). Powell, US patent
// 4826299 (1989), for lenses with a ridge.
#include <cmath>
#include <numbers>
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class LineKinkLaw final : public DescribedEffect {
 public:
  LineKinkLaw()
      : DescribedEffect(
            {.id = "outside.line_kink",
             .stage = Stage::kIllumination,
             .signature = {{"line_position", "along_line"}, {"column"}},
             .summary = "line bent at the ridge of its lens: s = k |X - X_0|",
             .reference = "Powell, US patent 4826299 (1989), lens with a ridge; general "
                          "knowledge: two faces make two lines",
             .parameters = {{"kink", 0, -0.2, 0.2, 0.005}, {"ridge_angle_deg", 0.3, -20, 20, 2}}}) {
  }

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double ridge = frame.plate.laser_distance_m * std::tan(p[1] * std::numbers::pi / 180);
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, k = p[0], before = std::move(scene.laser_irradiance_w_m2)](
                                      double x_m, double s_m) {
      return before(x_m, s_m - k * std::abs(x_m - ridge));
    };
  }
};

}  // namespace

OutsideLaw LineKink() {
  static const LineKinkLaw law;
  return {&law, "geometry", {{"ridge_angle_deg", -1.5, 1.5, false}}};
}

}  // namespace sightline::bench
