// SPDX-License-Identifier: Apache-2.0
// Charge above a threshold overflows along the column: a part f of the surplus leaves its pixel,
// half up and half down, with exp(-distance/reach). What would come to rest beyond the image's rim
// is lost.
#include <algorithm>
#include <cmath>
#include <vector>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class BloomingEffect final : public DescribedEffect {
 public:
  BloomingEffect()
      : DescribedEffect({.id = "sensor.blooming",
                         .stage = Stage::kSensor,
                         .signature = {{"saturated", "line_flanks", "background"},
                                       {"signal_level", "exposure_time_s"}},
                         .column_transport = ColumnTransport::kOverflow,
                         .summary = "part of the charge above a threshold runs along the column",
                         .reference = "Janesick, Scientific Charge-Coupled Devices (2001), section "
                                      "4.3 (blooming)",
                         .parameters = {{"blooming_fraction", 0, 0, 1, 0.2},
                                        {"threshold_electrons", 10000, 100, 1e6, 10000},
                                        {"reach_px", 20, 0.5, 1000, 20}}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>* /*previous*/,
                       const FrameSetup&, Parameters p) const override {
    const double fraction = p[0], threshold = p[1];
    const double ratio = std::exp(-1 / p[2]);
    const double first = 0.5 * (1 - ratio);  // share of the next pixel on one side
    std::vector<double> surplus(electrons.rows_px);
    for (int j = 0; j < electrons.columns_px; ++j) {
      for (int i = 0; i < electrons.rows_px; ++i) {
        surplus[i] = fraction * std::max(0.0, electrons.At(i, j) - threshold);
        electrons.At(i, j) -= surplus[i];
      }
      double running = 0;
      for (int i = 0; i < electrons.rows_px; ++i) {
        electrons.At(i, j) += first * running;
        running = surplus[i] + ratio * running;
      }
      running = 0;
      for (int i = electrons.rows_px - 1; i >= 0; --i) {
        electrons.At(i, j) += first * running;
        running = surplus[i] + ratio * running;
      }
    }
  }
};

}  // namespace

const Effect& Blooming() {
  static const BloomingEffect effect;
  return effect;
}

}  // namespace sightline
