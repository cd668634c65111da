// SPDX-License-Identifier: Apache-2.0
// Few pixels with high dark current, exponentially distributed with the mean 5000 electrons a
// second at the reference temperature, doubling as dark current does. Which ones is fixed for a
// camera: a pixel is hot if its own random number lies below the fraction.
#include <cmath>

#include "core/random/counter_random.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/pixel_pattern.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

constexpr double kMeanDarkCurrent_electrons_per_s = 5000;

class HotPixelsEffect final : public DescribedEffect {
 public:
  HotPixelsEffect()
      : DescribedEffect({.id = "sensor.hot_pixels",
                         .stage = Stage::kSensor,
                         .kind = EffectKind::kRandomPerPixel,
                         .signature = {{"dark_frames", "whole_image"}, {"exposure_time_s"}},
                         .summary = "a fraction of the pixels has a high dark current",
                         .reference = "EMVA 1288 R4.0 Linear, section 4 (defect pixels)",
                         .parameters = {{"hot_fraction", 0, 0, 0.1, 1e-3}}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>* /*previous*/,
                       const FrameSetup& frame, Parameters p) const override {
    const uint64_t seed = DeriveSeed(frame.seeds.camera, "hot pixels");
    const Sensor& sensor = frame.sensor;
    const double mean =
        kMeanDarkCurrent_electrons_per_s * frame.exposure_time_s *
        std::exp2((frame.sensor_temperature_c - sensor.dark_current_reference_temperature_c) /
                  sensor.dark_current_doubling_k);
    AddToSomePixels(electrons, frame.roi, seed, p[0], mean);
  }
};

}  // namespace

const Effect& HotPixels() {
  static const HotPixelsEffect effect;
  return effect;
}

}  // namespace sightline
