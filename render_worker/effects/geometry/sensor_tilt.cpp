// SPDX-License-Identifier: Apache-2.0
// Sensor turned about its columns' direction: its distance to the lens is b + u tan(tilt), so focus
// varies along the line. (The keystone it also makes, a relative change of scale by u tan(tilt)/b,
// is left out: a part in a thousand for a degree at 1 mm.)
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class SensorTiltEffect final : public DescribedEffect {
 public:
  SensorTiltEffect()
      : DescribedEffect({.id = "geometry.sensor_tilt",
                         .stage = Stage::kGeometry,
                         .signature = {{"line_core", "off_axis"}, {"field_position", "f_number"}},
                         .summary = "image distance b + u tan(tilt): focus varies over the sensor",
                         .reference = "Scheimpflug, GB patent 1196 (1904); thesis eq. 5.6",
                         .parameters = {{"sensor_tilt_deg", 0, -20, 20, 1}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;  // the field stays the same everywhere
    const double slope = std::tan(p[0] * std::numbers::pi / 180);
    const double b = optics.image_distance_m;
    optics.field_dependent = true;
    optics.curvature = [slope, b, before = std::move(optics.curvature)](double depth_m, double u_m,
                                                                        double v_m) {
      return before(depth_m, u_m, v_m) + (1 / b - 1 / (b + slope * u_m));
    };
  }
};

}  // namespace

const Effect& SensorTilt() {
  static const SensorTiltEffect effect;
  return effect;
}

}  // namespace sightline
