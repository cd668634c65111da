// SPDX-License-Identifier: Apache-2.0
// Fixed patterns of the sensor: sensitivity and offset differ from pixel to pixel. The sensor model
// (EMVA 1288) realises the patterns of single pixels; variances of independent ones add.
#include <cmath>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class PrnuEffect final : public DescribedEffect {
 public:
  PrnuEffect()
      : DescribedEffect({.id = "sensor.prnu",
                         .stage = Stage::kSensor,
                         .kind = EffectKind::kRandomPerPixel,
                         .signature = {{"line_core", "whole_image"}, {"signal_level"}},
                         .summary = "standard deviation of the pixels' sensitivity",
                         .reference = "EMVA 1288 R4.0 Linear, section 4 (PRNU1288)",
                         .parameters = {{"prnu_relative", 0, 0, 0.5, 0.01}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.prnu_relative = std::hypot(frame.sensor.prnu_relative, p[0]);
  }
};

class DsnuColumnPatternEffect final : public DescribedEffect {
 public:
  DsnuColumnPatternEffect()
      : DescribedEffect({.id = "sensor.dsnu_column_pattern",
                         .stage = Stage::kSensor,
                         .kind = EffectKind::kRandomPerColumn,
                         .signature = {{"dark_frames", "whole_image", "background"}, {"column"}},
                         .summary = "fixed offsets of columns and pixels, standard deviations",
                         .reference = "EMVA 1288 R4.0 Linear, section 4 (DSNU1288, column part)",
                         .parameters = {{"column_offset_electrons", 0, 0, 1000, 5},
                                        {"pixel_offset_electrons", 0, 0, 1000, 5}}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dsnu_electrons = std::hypot(frame.sensor.dsnu_electrons, p[1]);
  }
  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const uint64_t seed = DeriveSeed(frame.seeds.camera, "column offsets");
    std::vector<double> offset(electrons.columns_px);
    for (int j = 0; j < electrons.columns_px; ++j) {
      offset[j] =
          p[0] * CounterRandom(seed, static_cast<uint32_t>(frame.roi.column_px + j)).Normal();
    }
    for (int i = 0; i < electrons.rows_px; ++i) {
      for (int j = 0; j < electrons.columns_px; ++j) electrons.At(i, j) += offset[j];
    }
  }
  void OnLineOffsets(LineOffsets& offsets, Parameters p) const override {
    offsets.column_electrons = p[0];
  }
};

}  // namespace

const Effect& Prnu() {
  static const PrnuEffect effect;
  return effect;
}
const Effect& DsnuColumnPattern() {
  static const DsnuColumnPatternEffect effect;
  return effect;
}

}  // namespace sightline
