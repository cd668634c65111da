// SPDX-License-Identifier: Apache-2.0
// The focus of a fan lies on an arc: rays at the place X have travelled d + k X^2/(2 d) from the
// projector, in which a cylinder lens without correction has k of some ten. The radius w of the
// beam thus varies along the line; the power does not. Siegman, Lasers (1986), chapter 17 for
// w(z); Welford, Aberrations of Optical Systems (1986), for curved image fields.
#include <utility>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class LineFocusCurvatureLaw final : public DescribedEffect {
 public:
  LineFocusCurvatureLaw()
      : DescribedEffect(
            {.id = "outside.line_focus_curvature",
             .stage = Stage::kIllumination,
             .signature = {{"line_flanks", "along_line", "off_axis"},
                           {"column", "laser_distance_m"}},
             .summary = "width of the beam varies along the line as its focus lies on an arc",
             .reference = "Siegman, Lasers (1986), chapter 17; Welford, Aberrations of Optical "
                          "Systems (1986)",
             .parameters = {{"focus_curvature_relative", 0, -300, 300, 20}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const Laser laser = frame.laser;
    const double distance = frame.plate.laser_distance_m, centre = frame.plate.line_offset_m;
    const double radius = BeamRadius(laser, distance);
    scene.constant_along_line = false;
    scene.laser_irradiance_w_m2 = [=, k = p[0], before = std::move(scene.laser_irradiance_w_m2)](
                                      double x_m, double s_m) {
      const double path = distance + k * x_m * x_m / (2 * distance);
      const double ratio = BeamRadius(laser, path) / radius;
      return before(x_m, centre + (s_m - centre) / ratio) / ratio;
    };
  }
};

}  // namespace

OutsideLaw LineFocusCurvature() {
  static const LineFocusCurvatureLaw law;
  return {&law, "source", {}};
}

}  // namespace sightline::bench
