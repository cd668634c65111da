// SPDX-License-Identifier: Apache-2.0
// Exposure time not as set: always by the same, or scattered from frame to frame. Never below 0.
#include <algorithm>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr const char* kExposureTimeReference = "EMVA 1288 R4.0 Linear, section 2.1 (exposure time)";

class ExposureOffsetEffect final : public DescribedEffect {
 public:
  ExposureOffsetEffect()
      : DescribedEffect({.id = "time.exposure_offset",
                         .stage = Stage::kTime,
                         .signature = {{"line_core", "whole_image"}, {"exposure_time_s"}},
                         .summary = "true minus set exposure time",
                         .reference = kExposureTimeReference,
                         .parameters = {{"exposure_offset_s", 0, -0.1, 0.1, 5e-5}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.exposure_time_s = std::max(0.0, frame.exposure_time_s + p[0]);
  }
};

class ExposureJitterEffect final : public DescribedEffect {
 public:
  ExposureJitterEffect()
      : DescribedEffect({.id = "time.exposure_jitter",
                         .stage = Stage::kTime,
                         .kind = EffectKind::kRandomPerRecording,
                         .random_law = RandomLaw::kExposureTime,
                         .signature = {{"line_core", "whole_image"}, {"exposure_time_s"}},
                         .summary = "exposure time scatters normally",
                         .reference = kExposureTimeReference,
                         .parameters = {{"exposure_jitter_s", 0, 0, 0.1, 5e-5}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    CounterRandom random(DeriveSeed(frame.seeds.noise, "exposure time"), 0);
    frame.exposure_time_s = std::max(0.0, frame.exposure_time_s + p[0] * random.Normal());
  }
};

}  // namespace

const Effect& ExposureOffset() {
  static const ExposureOffsetEffect effect;
  return effect;
}
const Effect& ExposureJitter() {
  static const ExposureJitterEffect effect;
  return effect;
}

}  // namespace sightline
