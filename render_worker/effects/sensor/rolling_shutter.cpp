// SPDX-License-Identifier: Apache-2.0
// Rows exposed one after another, each as long as the others. Steady light and a plate at rest look
// the same at every moment: it shows only together with flickering light, as bands.
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class RollingShutterEffect final : public DescribedEffect {
 public:
  RollingShutterEffect()
      : DescribedEffect(
            {.id = "sensor.rolling_shutter",
             .stage = Stage::kSensor,
             .signature = {{"whole_image"}, {"row"}},
             .summary = "rows exposed one after another; shows in flickering light only",
             .reference = "Liang, Chang and Chen, IEEE Trans. Image Process. 17 (2008) 1323 "
                          "(rolling shutter)",
             .parameters = {{"row_time_s", 0, 0, 1e-3, 2e-5}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override { frame.row_time_s += p[0]; }
};

}  // namespace

const Effect& RollingShutter() {
  static const RollingShutterEffect effect;
  return effect;
}

}  // namespace sightline
