// SPDX-License-Identifier: Apache-2.0
// Signal without light: dark current, offset, and its drift over a set.
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class DarkCurrentEffect final : public DescribedEffect {
 public:
  DarkCurrentEffect()
      : DescribedEffect(
            {.id = "sensor.dark_current",
             .stage = Stage::kSensor,
             .signature = {{"whole_image", "background", "dark_frames"}, {"exposure_time_s"}},
             .inspection_fields = {{.field = "camera.sensor.dark_current_electrons_per_s",
                                    .operation = InspectionField::kShift}},
             .summary = "thermal electrons a second and pixel, at the sensor's reference "
                        "temperature",
             .reference = "EMVA 1288 R4.0 Linear, section 3 (dark current)",
             .parameters = {{"dark_current_electrons_per_s", 0, 0, 1e5, 50}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_current_electrons_per_s += p[0];
  }
};

class BlackLevelErrorEffect final : public DescribedEffect {
 public:
  BlackLevelErrorEffect()
      : DescribedEffect({.id = "sensor.black_level_error",
                         .stage = Stage::kSensor,
                         .signature = {.regions = {"whole_image", "background", "dark_frames"}},
                         .inspection_fields = {{.field = "camera.sensor.dark_mean_electrons",
                                                .operation = InspectionField::kShift}},
                         .summary = "mean dark signal not as stated: mu_d shifted",
                         .reference = "EMVA 1288 R4.0 Linear, section 2.1 (mean dark signal)",
                         .parameters = {{"black_level_shift_electrons", 0, -1000, 1000, 10}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_mean_electrons += p[0];
  }
};

class TemperatureDriftEffect final : public DescribedEffect {
 public:
  TemperatureDriftEffect()
      : DescribedEffect(
            {.id = "time.temperature_drift",
             .stage = Stage::kTime,
             .signature = {{"dark_frames", "background", "whole_image"}, {"timestamp_s"}},
             .summary = "mean dark signal mu_d + drift t, t since the laser was switched "
                        "on",
             .reference = "EMVA 1288 R4.0 Linear, section 3.2 (dark current and "
                          "temperature)",
             .parameters = {{"dark_drift_electrons_per_s", 0, -10, 10, 0.01}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_mean_electrons += p[0] * frame.timestamp_s;
  }
};

}  // namespace

const Effect& DarkCurrent() {
  static const DarkCurrentEffect effect;
  return effect;
}
const Effect& BlackLevelError() {
  static const BlackLevelErrorEffect effect;
  return effect;
}
const Effect& TemperatureDrift() {
  static const TemperatureDriftEffect effect;
  return effect;
}

}  // namespace sightline
