// SPDX-License-Identifier: Apache-2.0
// Light lost off axis: a second rim that cuts the pupil, or a fall-off beyond cos^4.
#include <cmath>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/pixel_pattern.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class MechanicalVignettingEffect final : public DescribedEffect {
 public:
  MechanicalVignettingEffect()
      : DescribedEffect({.id = "optics.mechanical_vignetting",
                         .stage = Stage::kOptics,
                         .signature = {{"off_axis", "along_line"}, {"field_position", "f_number"}},
                         .summary =
                             "a second rim, seen from off the axis shifted by a length times "
                             "tan(phi), cuts the pupil",
                         .reference = "Hecht, Optics, 5th ed., section 5.3 (vignetting)",
                         .parameters = {{"rim_radius_m", 0.1, 1e-4, 0.1, 0.09},
                                        {"rim_shift_per_tangent_m", 0, -0.1, 0.1, 0.01}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    const double rim = p[0];
    const double shift = p[1] / optics.image_distance_m;
    const Sensor& sensor = frame.sensor;
    const double corner_m =
        0.5 * sensor.pixel_pitch_m * std::hypot(sensor.columns_px, sensor.rows_px);
    // A rim that does not cut anywhere leaves the lens unchanged and uniform over the field.
    if (std::abs(shift) * corner_m + optics.pupil(0, 0).OuterRadius() <= rim) return;
    if (shift != 0) optics.field_dependent = true;
    optics.pupil = [rim, shift, before = std::move(optics.pupil)](double u_m, double v_m) {
      Pupil pupil = before(u_m, v_m);
      const PupilClip clip{shift * u_m, shift * v_m, rim};
      const double reach = std::hypot(clip.centre_u_m, clip.centre_v_m) + pupil.OuterRadius();
      if (reach > rim) pupil.clips.push_back(clip);
      return pupil;
    };
  }
};

class NaturalVignettingEffect final : public DescribedEffect {
 public:
  NaturalVignettingEffect()
      : DescribedEffect({.id = "optics.natural_vignetting",
                         .stage = Stage::kOptics,
                         .plates_can_show_it = false,
                         .summary = "fall-off cos^(4 + n)(phi) instead of cos^4(phi)",
                         .reference = "Hecht, Optics, 5th ed., section 5.3; thesis eq. 4.11",
                         .parameters = {{"extra_exponent", 0, -4, 20, 2}}}) {}

  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters p) const override {
    const double per_px = frame.sensor.pixel_pitch_m / frame.ImageDistance();
    MultiplyLight(light, false, [&](int column_px, int row_px) {
      const double u = column_px * per_px, v = row_px * per_px;
      return std::pow(1 + u * u + v * v, -0.5 * p[0]);
    });
  }
};

}  // namespace

const Effect& MechanicalVignetting() {
  static const MechanicalVignettingEffect effect;
  return effect;
}
const Effect& NaturalVignetting() {
  static const NaturalVignettingEffect effect;
  return effect;
}

}  // namespace sightline
