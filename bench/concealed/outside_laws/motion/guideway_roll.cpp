// SPDX-License-Identifier: Apache-2.0
// A guideway that is twisted rolls the camera as it travels: roll a (d_c - 0.35 m) about the
// optical axis. ISO 230-1:2012 (angular error motions of linear axes).
#include <cmath>
#include <numbers>
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class GuidewayRollLaw final : public DescribedEffect {
 public:
  GuidewayRollLaw()
      : DescribedEffect(
            {.id = "outside.guideway_roll",
             .stage = Stage::kGeometry,
             .signature = {{"line_position", "along_line"}, {"column", "camera_distance_m"}},
             .summary = "camera rolls in proportion to its distance along the guideway",
             .reference = "ISO 230-1:2012 (angular error motions of linear axes)",
             .parameters = {{"roll_deg_per_m", 0, -200, 200, 2}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    const double roll = p[0] * (frame.plate.camera_distance_m - 0.35) * std::numbers::pi / 180;
    if (roll == 0) return;
    scene.image_mapping = [c = std::cos(roll), s = std::sin(roll),
                           before = std::move(scene.image_mapping)](SensorPoint point) {
      if (before) point = before(point);
      return SensorPoint{c * point.u_m + s * point.v_m, c * point.v_m - s * point.u_m};
    };
  }
};

}  // namespace

OutsideLaw GuidewayRoll() {
  static const GuidewayRollLaw law;
  return {&law, "geometry", {}};
}

}  // namespace sightline::bench
