// SPDX-License-Identifier: Apache-2.0
// Focusing moves lens groups, and the image grows or shrinks by more than the distance of its
// plane says: scale 1 + a (0.35 m/d_foc - 1). Willson, Modeling and Calibration of Automated Zoom
// Lenses, CMU-RI-TR-94-03 (1994).
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class FocusBreathingLaw final : public DescribedEffect {
 public:
  FocusBreathingLaw()
      : DescribedEffect(
            {.id = "outside.focus_breathing",
             .stage = Stage::kOptics,
             .signature = {{"line_flanks", "line_position", "off_axis"}, {"focus_distance_m"}},
             .summary = "image scale depends on the focus setting: 1 + a (0.35 m/d_foc - 1)",
             .reference = "Willson, Modeling and Calibration of Automated Zoom Lenses, "
                          "CMU-RI-TR-94-03 (1994)",
             .parameters = {{"breathing_relative", 0, -0.5, 0.5, 0.02}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    const double scale = 1 + p[0] * (0.35 / frame.lens.focus_distance_m.value() - 1);
    if (scale == 1) return;
    scene.image_mapping = [scale, before = std::move(scene.image_mapping)](SensorPoint point) {
      if (before) point = before(point);
      return SensorPoint{point.u_m / scale, point.v_m / scale};
    };
  }
};

}  // namespace

OutsideLaw FocusBreathing() {
  static const FocusBreathingLaw law;
  return {&law, "geometry", {}};
}

}  // namespace sightline::bench
