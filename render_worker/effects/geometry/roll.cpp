// SPDX-License-Identifier: Apache-2.0
// Line not along the rows. The camera turns about its optical axis; the laser's line turns on the
// plate about its middle (X = 0, s = s0). Both angles are those of the line to the rows in the
// image, positive from +u to +v, so that they can be compared.
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

class CameraRollEffect final : public DescribedEffect {
 public:
  CameraRollEffect()
      : DescribedEffect(
            {.id = "geometry.camera_roll",
             .stage = Stage::kGeometry,
             .signature = {{"line_position", "along_line"}, {"column"}},
             .scope = EffectScope::kFlatPlate,
             .summary = "camera turned about its optical axis",
             .reference = "Luhmann et al., Close-Range Photogrammetry, 3rd ed., section 4.2",
             .parameters = {{"roll_deg", 0, -30, 30, 1}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;  // an empty mapping stays empty
    const double c = std::cos(p[0] * kDegree), s = std::sin(p[0] * kDegree);
    scene.image_mapping = [c, s, before = std::move(scene.image_mapping)](SensorPoint point) {
      if (before) point = before(point);
      return SensorPoint{c * point.u_m + s * point.v_m, c * point.v_m - s * point.u_m};
    };
  }
};

class LaserRollEffect final : public DescribedEffect {
 public:
  LaserRollEffect()
      : DescribedEffect({.id = "geometry.laser_roll",
                         .stage = Stage::kGeometry,
                         .signature = {{"line_position", "along_line"}, {"column"}},
                         .scope = EffectScope::kFlatPlate,
                         .summary = "laser line turned on the plate about its middle",
                         .reference = "thesis 3.3 (uncertain variables of the rig)",
                         .parameters = {{"roll_deg", 0, -30, 30, 1}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the line stays constant along X
    const double c = std::cos(p[0] * kDegree), s = std::sin(p[0] * kDegree);
    const double centre = frame.plate.line_offset_m;
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                       double s_m) {
      const double off = s_m - centre;
      return before(c * x_m + s * off, centre + c * off - s * x_m);
    };
  }
};

}  // namespace

const Effect& CameraRoll() {
  static const CameraRollEffect effect;
  return effect;
}
const Effect& LaserRoll() {
  static const LaserRollEffect effect;
  return effect;
}

}  // namespace sightline
