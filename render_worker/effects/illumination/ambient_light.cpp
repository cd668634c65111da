// SPDX-License-Identifier: Apache-2.0
// Other light on the plate: its radiance towards the camera, as photons of the laser's wavelength,
// with a linear gradient over the sensor; and the same from lamps on alternating current.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/illumination/ambient_radiance.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

// Adds radiance(X, s) to what is there.
void AddAmbient(PlateScene& scene, PlateFunction radiance) {
  if (!scene.ambient_radiance_w_m2_sr) {
    scene.ambient_radiance_w_m2_sr = std::move(radiance);
    return;
  }
  scene.ambient_radiance_w_m2_sr = [before = std::move(scene.ambient_radiance_w_m2_sr),
                                    radiance = std::move(radiance)](double x_m, double s_m) {
    return before(x_m, s_m) + radiance(x_m, s_m);
  };
}

class AmbientLightEffect final : public DescribedEffect {
 public:
  AmbientLightEffect()
      : DescribedEffect(
            {.id = "illumination.ambient_light",
             .stage = Stage::kIllumination,
             .signature = {{"background", "whole_image"}, {"exposure_time_s", "f_number"}},
             .scope = EffectScope::kFlatPlate,
             .inspection_fields = {{.field = "lighting.ambient.radiance_w_m2_sr",
                                    .operation = InspectionField::kShift,
                                    .is_radiance_of_plate = true},
                                   {.field = "", .parameter = 1},
                                   {.field = "", .parameter = 2}},
             .summary =
                 "other light on the plate, with a gradient from the centre of the sensor to "
                 "its right and lower edge; it is white: colour sensors see it about alike in all "
                 "channels (signals relative to the red one, which counts 661 nm photons)",
             .reference = "radiance invariance and aperture integration: thesis eq. 4.11",
             .parameters = {{"ambient_radiance_w_m2_sr", 0, 0, 100, 0.1, {}, kRadianceDecades},
                            {"gradient_u_relative", 0, -1, 1, 0.2},
                            {"gradient_v_relative", 0, -1, 1, 0.2},
                            {"green_to_red", 1, 0.05, 20, 0.5},
                            {"blue_to_red", 1, 0.05, 20, 0.5}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    const double radiance = p[0];
    if (radiance == 0) return;  // an empty function stays empty
    const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
    const double pitch = frame.sensor.pixel_pitch_m;
    const double slope_u = p[1] * magnification / (0.5 * frame.sensor.columns_px * pitch);
    const double slope_v = p[2] * magnification / (0.5 * frame.sensor.rows_px * pitch);
    AddAmbient(scene, [=](double x_m, double s_m) {
      return radiance * std::max(0.0, 1 + slope_u * x_m + slope_v * s_m);
    });
    if (frame.sensor.colour_filter != ColourFilter::kMono) {
      const auto efficiency = [&](int channel) {
        return frame.sensor.quantum_efficiency[channel].At(frame.laser.wavelength_m);
      };
      scene.ambient_channel_factor = {1, p[3] * efficiency(0) / efficiency(1),
                                      p[4] * efficiency(0) / efficiency(2)};
    }
  }
};

class AmbientFlickerEffect final : public DescribedEffect {
 public:
  AmbientFlickerEffect()
      : DescribedEffect(
            {.id = "time.ambient_flicker",
             .stage = Stage::kTime,
             .start_search = StartSearch::kPeriodogramOfTime,
             .signature = {{"background", "whole_image"},
                           {"exposure_time_s", "f_number", "timestamp_s"}},
             .scope = EffectScope::kFlatPlate,
             .summary =
                 "ambient light with 1 + m cos(2 pi f t), t since the laser was switched on; "
                 "the exposure takes its mean",
             .reference = "IEEE 1789-2015 (modulation of lamps)",
             .parameters = {{"ambient_radiance_w_m2_sr", 0, 0, 100, 0.1, {}, kRadianceDecades},
                            // Light that hardly flickers is ambient light.
                            {"flicker_depth", 0.3, 0, 1, 0.3},
                            {"flicker_frequency_hz", 100, 1, 10000, 50}}}) {}

  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0) return;
    // Mean of cos over the exposure.
    const double half_turn = std::numbers::pi * p[2] * frame.exposure_time_s;
    const double smoothing = half_turn == 0 ? 1 : std::sin(half_turn) / half_turn;
    const double turns_per_s = 2 * std::numbers::pi * p[2];
    const double phase = turns_per_s * frame.timestamp_s + half_turn;
    const double mean = p[0], modulation = p[0] * p[1] * smoothing;
    // With a rolling shutter every row has a phase of its own.
    const double rows_per_m =
        frame.ImageDistance() / (frame.plate.camera_distance_m * frame.sensor.pixel_pitch_m);
    const double phase_per_row = turns_per_s * frame.row_time_s;
    const int first_row = frame.roi.row_px;
    AddAmbient(scene, [=](double, double s_m) {
      return mean + modulation * std::cos(phase + phase_per_row * (s_m * rows_per_m - first_row));
    });
  }
};

}  // namespace

const Effect& AmbientLight() {
  static const AmbientLightEffect effect;
  return effect;
}
const Effect& AmbientFlicker() {
  static const AmbientFlickerEffect effect;
  return effect;
}

}  // namespace sightline
