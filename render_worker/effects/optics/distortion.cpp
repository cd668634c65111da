// SPDX-License-Identifier: Apache-2.0
// Distortion of the image: where a point of the ideal image (r) lies on the sensor (r'), radii in
// units of 5 mm. The plate is looked up by the inverse; parts are rendered through
// lens.distortion (Brown and Conrady), which gets the same coefficients in units of the image
// distance.
#include <cmath>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr double kReferenceRadius_m = 5e-3;
constexpr const char* kDistortionReference =
    "Brown, Close-range camera calibration, Photogrammetric Engineering 37 (1971) 855";

// Appends a mapping from sensor to ideal image: earlier effects lie nearer to the sensor.
void AppendMapping(PlateScene& scene, ImageMapping to_ideal) {
  if (!scene.image_mapping) {
    scene.image_mapping = std::move(to_ideal);
    return;
  }
  scene.image_mapping = [before = std::move(scene.image_mapping), to_ideal = std::move(to_ideal)](
                            SensorPoint point) { return to_ideal(before(point)); };
}

class RadialDistortionEffect final : public DescribedEffect {
 public:
  RadialDistortionEffect()
      : DescribedEffect({.id = "optics.radial_distortion",
                         .stage = Stage::kOptics,
                         .signature = {{"line_position", "off_axis"}, {"field_position"}},
                         .summary = "r' = r (1 + k1 (r/5 mm)^2)",
                         .reference = kDistortionReference,
                         .parameters = {{"k1_relative", 0, -0.1, 0.1, 0.01}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    const double scale = frame.ImageDistance() / kReferenceRadius_m;
    frame.lens.distortion.k1 += p[0] * scale * scale;
  }
  void OnPlate(PlateScene& scene, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;  // an empty mapping stays empty
    AppendMapping(scene, [k = p[0]](SensorPoint point) {
      const double distorted = std::hypot(point.u_m, point.v_m) / kReferenceRadius_m;
      // Newton's method for r + k r^3 = r'; the start is the solution to first order. Barrels fold
      // over beyond r^2 = -1/(3 k): the radius stays at the fold.
      double r = distorted;
      const double fold = k < 0 ? std::sqrt(-1 / (3 * k)) : INFINITY;
      for (int i = 0; i < 20; ++i) {
        r = std::min(r, 0.999 * fold);
        r -= (r + k * r * r * r - distorted) / (1 + 3 * k * r * r);
      }
      r = std::min(r, fold);
      const double factor = distorted > 0 ? r / distorted : 1;
      return SensorPoint{point.u_m * factor, point.v_m * factor};
    });
  }
};

class TangentialDistortionEffect final : public DescribedEffect {
 public:
  TangentialDistortionEffect()
      : DescribedEffect({.id = "optics.tangential_distortion",
                         .stage = Stage::kOptics,
                         .plates_can_show_it = false,
                         .summary = "u' = u + 2 p1 u v + p2 (r^2 + 2 u^2), v likewise, in 5 mm",
                         .reference = kDistortionReference,
                         .parameters = {{"p1_relative", 0, -0.02, 0.02, 0.002},
                                        {"p2_relative", 0, -0.02, 0.02, 0.002}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    const double scale = frame.ImageDistance() / kReferenceRadius_m;
    frame.lens.distortion.p1 += p[0] * scale;
    frame.lens.distortion.p2 += p[1] * scale;
  }
  void OnPlate(PlateScene& scene, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0 && p[1] == 0) return;  // an empty mapping stays empty
    AppendMapping(scene, [p1 = p[0], p2 = p[1]](SensorPoint point) {
      const double u0 = point.u_m / kReferenceRadius_m, v0 = point.v_m / kReferenceRadius_m;
      double u = u0, v = v0;
      for (int i = 0; i < 20; ++i) {  // contraction: the terms are small
        const double r2 = u * u + v * v;
        const double du = 2 * p1 * u * v + p2 * (r2 + 2 * u * u);
        const double dv = p1 * (r2 + 2 * v * v) + 2 * p2 * u * v;
        u = u0 - du;
        v = v0 - dv;
      }
      return SensorPoint{u * kReferenceRadius_m, v * kReferenceRadius_m};
    });
  }
};

}  // namespace

const Effect& RadialDistortion() {
  static const RadialDistortionEffect effect;
  return effect;
}
const Effect& TangentialDistortion() {
  static const TangentialDistortionEffect effect;
  return effect;
}

}  // namespace sightline
