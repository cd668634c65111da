// SPDX-License-Identifier: Apache-2.0
// Charge gathered while the image is shifted along the columns for readout. All pixels of a column
// pass under all its light: each gains r times the mean of the column over the whole sensor, r the
// time of readout over that of exposure. (The light outside the region of interest counts as none:
// the line lies inside.)
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class SmearEffect final : public DescribedEffect {
 public:
  SmearEffect()
      : DescribedEffect(
            {.id = "sensor.smear",
             .stage = Stage::kSensor,
             .signature = {{"background", "line_flanks"}, {"exposure_time_s", "column"}},
             .column_transport = ColumnTransport::kReadout,
             .summary = "trail along the column: r times the column's mean over the "
                        "sensor's rows",
             .reference = "Janesick, Scientific Charge-Coupled Devices (2001), section "
                          "5.3 (frame transfer smear)",
             .parameters = {{"smear_relative", 0, 0, 1, 0.02}}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>* /*previous*/,
                       const FrameSetup& frame, Parameters p) const override {
    for (int j = 0; j < electrons.columns_px; ++j) {
      double sum = 0;
      for (int i = 0; i < electrons.rows_px; ++i) sum += electrons.At(i, j);
      const double trail = p[0] * sum / frame.sensor.rows_px;
      for (int i = 0; i < electrons.rows_px; ++i) electrons.At(i, j) += trail;
    }
  }
};

}  // namespace

const Effect& Smear() {
  static const SmearEffect effect;
  return effect;
}

}  // namespace sightline
