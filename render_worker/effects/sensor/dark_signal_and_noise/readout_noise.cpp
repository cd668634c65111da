// SPDX-License-Identifier: Apache-2.0
// Temporal noise of the readout: of pixels, and common to a row.
#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class ReadNoiseExcessEffect final : public DescribedEffect {
 public:
  ReadNoiseExcessEffect()
      : DescribedEffect({.id = "sensor.read_noise_excess",
                         .stage = Stage::kSensor,
                         .signature = {.regions = {"temporal_noise", "dark_frames"}},
                         .inspection_fields = {{.field = "camera.sensor.dark_noise_electrons"}},
                         .summary = "temporal dark noise sigma_d times a factor",
                         .reference = "EMVA 1288 R4.0 Linear, section 2.2 (temporal dark noise)",
                         .parameters = {{"noise_factor", 1, 0.1, 20, 0.5}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_noise_electrons *= p[0];
  }
};

class RowNoiseEffect final : public DescribedEffect {
 public:
  RowNoiseEffect()
      : DescribedEffect({.id = "sensor.row_noise",
                         .stage = Stage::kSensor,
                         .kind = EffectKind::kRandomPerRow,
                         .signature = {{"temporal_noise", "dark_frames"}, {"row"}},
                         .summary = "rows jump from frame to frame, normally distributed",
                         .reference = "EMVA 1288 R4.0 Linear, section 4 (row variation)",
                         .parameters = {{"row_noise_electrons", 0, 0, 1000, 3}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const uint64_t seed = DeriveSeed(frame.seeds.noise, "row noise");
    for (int i = 0; i < electrons.rows_px; ++i) {
      const double jump =
          p[0] * CounterRandom(seed, static_cast<uint32_t>(frame.roi.row_px + i)).Normal();
      for (int j = 0; j < electrons.columns_px; ++j) electrons.At(i, j) += jump;
    }
  }
  void OnLineOffsets(LineOffsets& offsets, Parameters p) const override {
    offsets.row_electrons = p[0];
  }
};

}  // namespace

const Effect& ReadNoiseExcess() {
  static const ReadNoiseExcessEffect effect;
  return effect;
}
const Effect& RowNoise() {
  static const RowNoiseEffect effect;
  return effect;
}

}  // namespace sightline
