// SPDX-License-Identifier: Apache-2.0
// From charge to numbers: capacity and gain.
#include <algorithm>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class LowerFullWellEffect final : public DescribedEffect {
 public:
  LowerFullWellEffect()
      : DescribedEffect(
            {.id = "sensor.lower_full_well",
             .stage = Stage::kSensor,
             .signature = {{"saturated", "histogram"}, {"signal_level", "exposure_time_s"}},
             .summary = "pixels are full before the converter is: a plateau below the "
                        "largest number",
             .reference = "EMVA 1288 R4.0 Linear, section 2.4 (saturation capacity)",
             .parameters = {{"full_well_electrons", 1e7, 10, 1e7, 5e6}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.saturation_capacity_electrons =
        std::min(frame.sensor.saturation_capacity_electrons, p[0]);
  }
};

class GainErrorEffect final : public DescribedEffect {
 public:
  GainErrorEffect()
      : DescribedEffect(
            {.id = "sensor.gain_error",
             .stage = Stage::kSensor,
             .signature = {{"whole_image", "temporal_noise", "dark_frames"}, {"signal_level"}},
             .inspection_fields = {{.field = "camera.sensor.gain_dn_per_electron"}},
             .summary = "overall system gain K: true over stated",
             .reference = "EMVA 1288 R4.0 Linear, section 2.2 (system gain)",
             .parameters = {{"gain_factor", 1, 0.2, 5, 0.1}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.gain_dn_per_electron *= p[0];
  }
};

}  // namespace

const Effect& LowerFullWell() {
  static const LowerFullWellEffect effect;
  return effect;
}
const Effect& GainError() {
  static const GainErrorEffect effect;
  return effect;
}

}  // namespace sightline
