// SPDX-License-Identifier: Apache-2.0
// Charge left behind at readout is added to the next frame: c_n = q_n + l c_(n-1), of which 1 - l
// is read out. Expressed by the previous readout: (1 - l) q_n + l previous. Without a previous
// frame the pixel was empty.
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class ImageLagEffect final : public DescribedEffect {
 public:
  ImageLagEffect()
      : DescribedEffect(
            {.id = "sensor.image_lag",
             .stage = Stage::kSensor,
             .signature = {{"background", "dark_frames"}, {"burst_frame_index", "signal_level"}},
             .summary = "part of the charge of the burst's previous frame",
             .reference = "Fossum and Hondongwa, IEEE J. Electron Devices Soc. 2 (2014) "
                          "33 (pinned photodiode: lag)",
             .parameters = {{"lag_fraction", 0, 0, 0.5, 0.02}}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>* previous, const FrameSetup&,
                       Parameters p) const override {
    for (double& e : electrons.values) e *= 1 - p[0];
    if (previous == nullptr || previous->values.size() != electrons.values.size()) return;
    for (size_t i = 0; i < electrons.values.size(); ++i) {
      electrons.values[i] += p[0] * previous->values[i];
    }
  }
};

}  // namespace

const Effect& ImageLag() {
  static const ImageLagEffect effect;
  return effect;
}

}  // namespace sightline
