// SPDX-License-Identifier: Apache-2.0
// Image that moves across the line as A sin(2 pi f t + phase) during the exposure; the phase is
// random for every recording.
#include <numbers>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/time/sinusoidal_motion.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class VibrationBlurEffect final : public DescribedEffect {
 public:
  VibrationBlurEffect()
      : DescribedEffect({.id = "time.vibration_blur",
                         .stage = Stage::kTime,
                         .kind = EffectKind::kRandomPerRecording,
                         .random_law = RandomLaw::kVibration,
                         .signature = {{"line_core", "line_position"}, {"exposure_time_s"}},
                         .realisation_is_estimated = true,
                         .summary = "image moves across the line with A sin(2 pi f t + phase)",
                         .reference =
                             "Goodman, Introduction to Fourier Optics, 4th ed., chapter 7; "
                             "Lohmann and Paris, Appl. Opt. 4 (1965) 393",
                         .parameters = {{"vibration_amplitude_px", 0, 0, 50, 1},
                                        {"vibration_frequency_hz", 50, 0.1, 1e5, 50}}}) {}

  void OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;  // the list of transfer functions stays as it is
    CounterRandom random(DeriveSeed(frame.seeds.noise, "vibration phase"), 0);
    optics.transfer.push_back(SinusoidalMotionTransfer(p[0] * frame.sensor.pixel_pitch_m,
                                                       p[1] * frame.exposure_time_s,
                                                       2 * std::numbers::pi * random.Uniform()));
  }
};

}  // namespace

const Effect& VibrationBlur() {
  static const VibrationBlurEffect effect;
  return effect;
}

}  // namespace sightline
