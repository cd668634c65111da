// SPDX-License-Identifier: Apache-2.0
// Power of the laser: wrong, warming up, or different from recording to recording.
#include <algorithm>
#include <cmath>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class PowerErrorEffect final : public DescribedEffect {
 public:
  PowerErrorEffect()
      : DescribedEffect({.id = "illumination.power_error",
                         .stage = Stage::kIllumination,
                         .signature = {{"line_core", "whole_image"}, {"signal_level"}},
                         .inspection_fields = {{.field = "laser.power_w"}},
                         .summary = "power not as stated: P times a factor",
                         .reference = "thesis eq. 5.4",
                         .parameters = {{"amplitude_factor", 1, 0.1, 10, 0.2}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override { frame.laser.power_w *= p[0]; }
};

class PowerDriftEffect final : public DescribedEffect {
 public:
  PowerDriftEffect()
      : DescribedEffect({.id = "illumination.power_drift",
                         .stage = Stage::kIllumination,
                         .signature = {{"line_core", "whole_image"}, {"timestamp_s"}},
                         .summary = "power P (1 + a exp(-t/tau)) after switching on",
                         .reference = "ISO 11554:2017 (stability of laser power)",
                         .parameters = {{"drift_relative", 0, -0.9, 5, 0.1},
                                        {"drift_time_s", 600, 1, 1e5, 600}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= 1 + p[0] * std::exp(-frame.timestamp_s / p[1]);
  }
};

class PowerNoiseEffect final : public DescribedEffect {
 public:
  PowerNoiseEffect()
      : DescribedEffect({.id = "illumination.power_noise",
                         .stage = Stage::kIllumination,
                         .kind = EffectKind::kRandomPerRecording,
                         .random_law = RandomLaw::kPower,
                         .signature = {{"line_core", "whole_image"}, {"timestamp_s"}},
                         .summary = "power differs between recordings at random, normally",
                         .reference = "ISO 11554:2017 (relative power fluctuation)",
                         .parameters = {{"power_noise_relative", 0, 0, 0.5, 0.03}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    CounterRandom random(DeriveSeed(frame.seeds.noise, "laser power"), 0);
    frame.laser.power_w *= std::max(0.0, 1 + p[0] * random.Normal());
  }
};

}  // namespace

const Effect& PowerError() {
  static const PowerErrorEffect effect;
  return effect;
}
const Effect& PowerDrift() {
  static const PowerDriftEffect effect;
  return effect;
}
const Effect& PowerNoise() {
  static const PowerNoiseEffect effect;
  return effect;
}

}  // namespace sightline
