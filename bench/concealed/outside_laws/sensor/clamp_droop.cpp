// SPDX-License-Identifier: Apache-2.0
// A black-level clamp follows the signal of the rows read before: row i reads less by a c_i, with
// c_(i+1) = c_i + (m_i - c_i)/memory, m the mean of a row. The shadow below the line fades over
// some rows. US patent 4553169 (1985) for clamps of the black level.

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class ClampDroopLaw final : public DescribedEffect {
 public:
  ClampDroopLaw()
      : DescribedEffect(
            {.id = "outside.clamp_droop",
             .stage = Stage::kSensor,
             .signature = {{"line_flanks", "background"}, {"signal_level", "exposure_time_s"}},
             .summary = "black level falls by a share of the preceding rows' fading mean",
             .reference = "US patent 4553169 (1985), clamps of the black level; general knowledge: "
                          "such a loop lags behind the signal",
             .parameters = {{"droop_relative", 0, 0, 1, 0.02}, {"memory_rows", 30, 1, 1000, 30}}}) {
  }

  void OnElectrons(Image<double>& electrons, const FrameSetup&, Parameters p) const override {
    if (p[0] == 0) return;
    double clamp = 0;
    for (int i = 0; i < electrons.rows_px; ++i) {
      double* row = electrons.Row(i);
      double sum = 0;
      for (int j = 0; j < electrons.columns_px; ++j) {
        sum += row[j];
        row[j] -= p[0] * clamp;
      }
      clamp += (sum / electrons.columns_px - clamp) / p[1];
    }
  }
};

}  // namespace

OutsideLaw ClampDroop() {
  static const ClampDroopLaw law;
  return {&law, "readout", {{"memory_rows", 8, 60}}};
}

}  // namespace sightline::bench
