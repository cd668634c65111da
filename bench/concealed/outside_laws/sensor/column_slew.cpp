// SPDX-License-Identifier: Apache-2.0
// The source follower of a pixel drives the wire of its column. The current source at the end of
// the wire discharges it at the slew rate I/C at most, so that the number read from row to row can
// fall by full scale/p only: e_i = max(e_i, e_(i-1) - full scale/p). Rising edges are fast. A
// bright line leaves a tail that falls linearly and is the longer the brighter the line is.
#include <algorithm>

#include "bench/concealed/outside_laws/outside_laws.h"
#include "render_worker/effects/described_effect.h"

namespace sightline::bench {
namespace {

class ColumnSlewLaw final : public DescribedEffect {
 public:
  ColumnSlewLaw()
      : DescribedEffect(
            {.id = "outside.column_slew",
             .stage = Stage::kSensor,
             .signature = {{"line_flanks"}, {"signal_level", "exposure_time_s"}},
             .summary = "from row to row the signal falls by full scale/p at most",
             .reference = "general knowledge: slew rate I/C of a source follower with a constant "
                          "current load",
             .parameters = {{"rows_per_full_scale", 0, 0, 1000, 20}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    const double fall = frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron / p[0];
    for (int i = 1; i < electrons.rows_px; ++i) {
      const double* before = electrons.Row(i - 1);
      double* row = electrons.Row(i);
      for (int j = 0; j < electrons.columns_px; ++j) row[j] = std::max(row[j], before[j] - fall);
    }
  }
};

}  // namespace

OutsideLaw ColumnSlew() {
  static const ColumnSlewLaw law;
  return {&law, "readout", {}};
}

}  // namespace sightline::bench
