// SPDX-License-Identifier: Apache-2.0
// Gaussian beam: quality, place of the waist, wavelength.
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class BeamQualityEffect final : public DescribedEffect {
 public:
  BeamQualityEffect()
      : DescribedEffect(
            {.id = "illumination.beam_quality",
             .stage = Stage::kIllumination,
             .signature = {{"line_core", "line_flanks"}, {"laser_distance_m", "camera_distance_m"}},
             .inspection_fields = {{.field = "laser.beam_quality_m2"}},
             .summary = "waist M^2 lambda/(pi delta), divergence as stated",
             .reference = "ISO 11146-1:2021 (beam propagation ratio)",
             .parameters = {{"m2", 1, 1, 20, 0.5}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.beam_quality_m2 *= p[0];
  }
};

class BeamFocusEffect final : public DescribedEffect {
 public:
  BeamFocusEffect()
      : DescribedEffect({.id = "illumination.beam_focus",
                         .stage = Stage::kIllumination,
                         .signature = {{"line_core", "line_flanks"}, {"laser_distance_m"}},
                         .inspection_fields = {{.field = "laser.beam_focus_distance_m",
                                                .operation = InspectionField::kShift}},
                         .summary = "waist of the beam at another distance",
                         .reference = "thesis eq. 5.2",
                         .parameters = {{"beam_focus_shift_m", 0, -1, 1, 0.05}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.beam_focus_distance_m += p[0];
  }
};

class WavelengthErrorEffect final : public DescribedEffect {
 public:
  WavelengthErrorEffect()
      : DescribedEffect(
            {.id = "illumination.wavelength_error",
             .stage = Stage::kIllumination,
             .signature = {{"speckle", "line_core"}, {"f_number"}},
             .inspection_fields = {{.field = "laser.wavelength_m",
                                    .operation = InspectionField::kShift}},
             .summary = "another wavelength: diffraction, waist and photon energy change",
             .reference = "thesis eq. 4.24, 4.27, 5.2",
             .parameters = {{"wavelength_shift_m", 0, -1e-7, 1e-7, 5e-9}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override { frame.laser.wavelength_m += p[0]; }
};

}  // namespace

const Effect& BeamQuality() {
  static const BeamQualityEffect effect;
  return effect;
}
const Effect& BeamFocus() {
  static const BeamFocusEffect effect;
  return effect;
}
const Effect& WavelengthError() {
  static const WavelengthErrorEffect effect;
  return effect;
}

}  // namespace sightline
