// SPDX-License-Identifier: Apache-2.0
// Sensors that read odd and even columns by two amplifiers or converters (taps): their gains differ
// a little. The mean of both is the stated gain. The gain multiplies all charge of a pixel, its
// dark signal included: factor 1 + d/2 in odd columns and 1 - d/2 in even ones.
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class ColumnGainEffect final : public DescribedEffect {
 public:
  ColumnGainEffect()
      : DescribedEffect(
            {.id = "sensor.column_gain",
             .stage = Stage::kSensor,
             .signature = {{"line_core", "dark_frames", "whole_image"}, {"column", "signal_level"}},
             .columns_alternate = true,
             .summary = "gain of odd minus even columns, over their mean; columns are counted from "
                        "the principal point",
             .reference = "Holst and Lomheim, CMOS/CCD Sensors and Camera Systems, 2nd ed., "
                          "chapter 3 (multiple readout taps)",
             .parameters = {{"gain_difference_relative", 0, -0.5, 0.5, 0.02}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    for (int column = 0; column < electrons.columns_px; ++column) {
      // The remainder of a negative odd number is -1.
      const bool odd = (frame.roi.column_px + column) % 2 != 0;
      const double factor = 1 + (odd ? 0.5 : -0.5) * p[0];
      for (int row = 0; row < electrons.rows_px; ++row) electrons.At(row, column) *= factor;
    }
  }
};

}  // namespace

const Effect& ColumnGain() {
  static const ColumnGainEffect effect;
  return effect;
}

}  // namespace sightline
