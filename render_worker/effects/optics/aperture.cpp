// SPDX-License-Identifier: Apache-2.0
// The diaphragm: its diameter, its shape, and what the lens lets through.
#include <cmath>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class FNumberErrorEffect final : public DescribedEffect {
 public:
  FNumberErrorEffect()
      : DescribedEffect({.id = "optics.f_number_error",
                         .stage = Stage::kOptics,
                         .signature = {{"line_core", "speckle", "whole_image"},
                                       {"f_number", "camera_distance_m"}},
                         .inspection_fields = {{.field = "lens.f_number"}},
                         .summary = "aperture not as set: true over set f-number",
                         .reference = "ISO 517:2008 (apertures of photographic lenses)",
                         .parameters = {{"f_number_factor", 1, 0.3, 3, 0.15}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override { frame.lens.f_number *= p[0]; }
};

class TransmissionErrorEffect final : public DescribedEffect {
 public:
  TransmissionErrorEffect()
      : DescribedEffect(
            {.id = "optics.transmission_error",
             .stage = Stage::kOptics,
             .signature = {{"line_core", "whole_image"}, {"signal_level"}},
             .inspection_fields = {{.field = "lens.transmission", .may_stay_an_effect = true}},
             .summary = "transmission of the lens times a factor",
             .reference = "thesis 4.7.1 and 5.3.1 (transmission efficiency)",
             .parameters = {{"amplitude_factor", 1, 0.1, 10, 0.2}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override { frame.lens.transmission *= p[0]; }
};

class PolygonApertureEffect final : public DescribedEffect {
 public:
  PolygonApertureEffect()
      : DescribedEffect({.id = "optics.polygon_aperture",
                         .stage = Stage::kOptics,
                         .signature = {{"line_flanks", "speckle"}, {"f_number"}},
                         .summary = "regular polygon of this many blades (rounded; below 3: as the "
                                    "lens has it), area as before",
                         .reference = "Goodman, Introduction to Fourier Optics, 4th ed., chapter 7",
                         .parameters = {{.name = "blades",
                                         .null_value = 0,
                                         .lower = 0,
                                         .upper = 24,
                                         .prior_scale = 6,
                                         .discrete_values = {5, 6, 7, 8, 9}}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    const int blades = static_cast<int>(std::lround(p[0]));
    if (blades >= 3) frame.lens.aperture_blades = blades;
  }
};

}  // namespace

const Effect& FNumberError() {
  static const FNumberErrorEffect effect;
  return effect;
}
const Effect& TransmissionError() {
  static const TransmissionErrorEffect effect;
  return effect;
}
const Effect& PolygonAperture() {
  static const PolygonApertureEffect effect;
  return effect;
}

}  // namespace sightline
