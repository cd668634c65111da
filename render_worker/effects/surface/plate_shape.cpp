// SPDX-License-Identifier: Apache-2.0
// Plate that is tilted (about the axis across the line) or curved. A place raised by h towards the
// camera is nearer to camera and laser, and the sheet, which comes from the side of positive s,
// meets it h tan(theta) farther on that side: that is what triangulation measures.
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

void RaisePlate(PlateScene& scene, const FrameSetup& frame, const PlateFunction& rise_m) {
  const Laser laser = frame.laser;
  const double distance = frame.plate.laser_distance_m;
  const double cosine = std::cos(frame.plate.incidence_angle_rad);
  const double tangent = std::tan(frame.plate.incidence_angle_rad);
  const double centre = frame.plate.line_offset_m;
  const double radius = BeamRadius(laser, distance);
  const double peak = PeakIrradiance(laser, distance);
  scene.constant_along_line = false;
  scene.laser_irradiance_w_m2 = [=, before = std::move(scene.laser_irradiance_w_m2)](double x_m,
                                                                                     double s_m) {
    const double rise = rise_m(x_m, s_m);
    const double nearer = distance - rise / cosine;
    const double s_on_sheet = s_m - rise * tangent;
    // Profile of the flat plate, scaled to width and irradiance at this distance.
    const double scaled = centre + (s_on_sheet - centre) * (radius / BeamRadius(laser, nearer));
    return before(x_m, scaled) * (PeakIrradiance(laser, nearer) / peak);
  };
  if (!scene.height_m) {
    scene.height_m = rise_m;
  } else {
    scene.height_m = [rise_m, before = std::move(scene.height_m)](double x_m, double s_m) {
      return before(x_m, s_m) + rise_m(x_m, s_m);
    };
  }
}

class TiltedPlateEffect final : public DescribedEffect {
 public:
  TiltedPlateEffect()
      : DescribedEffect({.id = "surface.tilted_plate",
                         .stage = Stage::kSurface,
                         .signature = {{"along_line"}, {"column", "camera_distance_m"}},
                         .scope = EffectScope::kFlatPlate,
                         .summary = "height X tan(tilt): distance, focus and line position change "
                                    "along the line",
                         .reference = "thesis eq. 1.1-1.5 (triangulation)",
                         .parameters = {{"tilt_deg", 0, -30, 30, 2}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // a plate without height is flat
    const double slope = std::tan(p[0] * std::numbers::pi / 180);
    RaisePlate(scene, frame, [slope](double x_m, double) { return slope * x_m; });
  }
};

class CurvedPlateEffect final : public DescribedEffect {
 public:
  CurvedPlateEffect()
      : DescribedEffect(
            {.id = "surface.curved_plate",
             .stage = Stage::kSurface,
             .signature = {{"along_line", "off_axis"}, {"field_position", "camera_distance_m"}},
             .scope = EffectScope::kFlatPlate,
             .summary = "height (X^2 + s^2) kappa/2: positive is hollow",
             .reference = "thesis eq. 1.1-1.5 (triangulation)",
             .parameters = {{"curvature_per_m", 0, -10, 10, 0.5}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // a plate without height is flat
    RaisePlate(scene, frame, [half = 0.5 * p[0]](double x_m, double s_m) {
      return half * (x_m * x_m + s_m * s_m);
    });
  }
};

}  // namespace

const Effect& TiltedPlate() {
  static const TiltedPlateEffect effect;
  return effect;
}
const Effect& CurvedPlate() {
  static const CurvedPlateEffect effect;
  return effect;
}

}  // namespace sightline
