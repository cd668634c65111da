// SPDX-License-Identifier: Apache-2.0
// Effects through the whole chain of a plate: off is bit-identical, on shows in the numbers where
// the physics says so.
#include <gtest/gtest.h>

#include <cmath>

#include "render_worker/image_chain/form_image.h"
#include "tests/render_worker/effects/test_frame.h"

namespace sightline {
namespace {

// A small region with the line in its middle; at f/8 two sub-pixels suffice.
FrameSetup ChainFrame() {
  FrameSetup frame = TestFrame();
  frame.lens.f_number = 8;
  frame.plate.line_offset_m = 0;
  frame.roi = {-20, -16, 40, 32};
  frame.exposure_time_s = 5e-3;
  return frame;
}

FormedImage Render(const FrameSetup& frame, const std::vector<ActiveEffect>& effects,
                   const Image<double>* previous = nullptr) {
  absl::StatusOr<FormedImage> formed = RenderPlateFrame(frame, effects, previous, 1);
  EXPECT_TRUE(formed.ok()) << formed.status();
  return formed.ok() ? std::move(*formed) : FormedImage();
}

ActiveEffect Active(const std::string& id,
                    const std::vector<std::pair<std::string, double>>& values) {
  const Effect& effect = TheEffect(id);
  return {&effect, WithParameters(effect, values)};
}

double MeanDn(const FormedImage& image) {
  double sum = 0;
  for (const uint16_t dn : image.raw_dn.values) sum += dn;
  return sum / static_cast<double>(image.raw_dn.values.size());
}

double MeanElectrons(const FormedImage& image) {
  double sum = 0;
  for (const double electrons : image.mean_photo_electrons.values) sum += electrons;
  return sum / static_cast<double>(image.mean_photo_electrons.values.size());
}

TEST(Chain, NullParametersGiveTheSameBytes) {
  const FrameSetup frame = ChainFrame();
  const FormedImage off = Render(frame, {});
  EXPECT_GT(MeanDn(off), 5);
  std::vector<ActiveEffect> all;
  for (const Effect* effect : AllEffects()) {
    all.push_back({effect, WithParameters(*effect, {})});
    const FormedImage on = Render(frame, {all.back()});
    EXPECT_EQ(on.raw_dn, off.raw_dn) << effect->description().id;
    EXPECT_EQ(on.mean_photo_electrons, off.mean_photo_electrons) << effect->description().id;
  }
  EXPECT_EQ(Render(frame, all).mean_photo_electrons, off.mean_photo_electrons);
  EXPECT_EQ(Render(frame, all).raw_dn, off.raw_dn);
}

// Almost closed pupils spread their light beyond all bounds; memory has some.
TEST(Chain, AlmostNothingOfThePupilIsLeft) {
  const FrameSetup frame = ChainFrame();
  const double all = MeanElectrons(Render(frame, {}));
  // f/8 at 16 mm: the pupil's radius is 1 mm. Light passes by area, and part of it leaves the
  // region.
  const double closed = MeanElectrons(
      Render(frame, {Active("optics.mechanical_vignetting", {{"rim_radius_m", 1e-4}})}));
  EXPECT_GT(closed, 0);
  EXPECT_LT(closed, 0.011 * all);
  // At the bounds the rim lies beside the pupil off the axis.
  for (const double shift : {-0.1, 0.1}) {
    FrameSetup off_axis = frame;
    off_axis.roi.row_px = 300;
    const FormedImage dark =
        Render(off_axis, {Active("optics.mechanical_vignetting",
                                 {{"rim_radius_m", 1e-4}, {"rim_shift_per_tangent_m", shift}})});
    EXPECT_LT(MeanElectrons(dark), 0.011 * all);
  }
}

// Strong enough to be seen on this frame.
TEST(Chain, EveryEffectCanBeSeen) {
  FrameSetup frame = ChainFrame();
  frame.roi.column_px = 400;  // off the axis, where aberrations and distortion are
  const FormedImage off = Render(frame, {});
  const Image<double> previous(frame.roi.columns_px, frame.roi.rows_px, 2000.0);
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    if (description.id == "sensor.rolling_shutter") continue;  // needs light that changes
    std::vector<double> p = WithParameters(*effect, {});
    const EffectParameter& dial = description.parameters[0];
    const double room =
        dial.upper > dial.null_value ? dial.upper - dial.null_value : dial.lower - dial.null_value;
    p[0] += std::copysign(std::min(3 * dial.prior_scale, std::abs(room)), room);
    if (description.id == "optics.dust" || description.id == "sensor.hot_pixels" ||
        description.id == "illumination.line_bow") {
      p[0] = dial.upper;
    }
    if (description.id == "optics.mechanical_vignetting") p[0] = 8e-4;  // the pupil's is 1 mm
    if (description.id == "sensor.lower_full_well") p[0] = 300;
    if (description.id == "sensor.blooming") p = {1, 200, 10};
    const FormedImage on = Render(frame, {{effect, p}}, &previous);
    EXPECT_NE(on.raw_dn, off.raw_dn) << description.id;
  }
}

TEST(Chain, NothingButTheSensorShowsInDarkFrames) {
  FrameSetup frame = ChainFrame();
  frame.shutter_open = false;
  frame.laser_on = false;
  const FormedImage off = Render(frame, {});
  for (const Effect* effect : AllEffects()) {
    const Stage stage = effect->description().stage;
    if (stage == Stage::kSensor || stage == Stage::kTime) continue;
    std::vector<double> p = WithParameters(*effect, {});
    const EffectParameter& dial = effect->description().parameters[0];
    p[0] = dial.upper > dial.null_value ? std::min(dial.upper, dial.null_value + dial.prior_scale)
                                        : std::max(dial.lower, dial.null_value - dial.prior_scale);
    EXPECT_EQ(Render(frame, {{effect, p}}).raw_dn, off.raw_dn) << effect->description().id;
  }
}

// Brightness of the mean image by closed form; speckle is the same, so ratios are nearly exact.
TEST(Chain, BrightnessFollowsTheFactors) {
  FrameSetup frame = ChainFrame();
  frame.speckle = false;
  const double off = Sum(Render(frame, {}).mean_photo_electrons);
  const auto ratio = [&](const std::string& id,
                         const std::vector<std::pair<std::string, double>>& values) {
    return Sum(Render(frame, {Active(id, values)}).mean_photo_electrons) / off;
  };
  EXPECT_NEAR(ratio("illumination.power_error", {{"amplitude_factor", 1.3}}), 1.3, 1e-5);
  EXPECT_NEAR(ratio("surface.albedo_error", {{"amplitude_factor", 1.3}}), 1.3, 1e-5);
  EXPECT_NEAR(ratio("optics.transmission_error", {{"amplitude_factor", 1.3}}), 1.3, 1e-5);
  // 1/N^2, but for what diffraction moves out of the region.
  EXPECT_NEAR(ratio("optics.f_number_error", {{"f_number_factor", 0.9}}), 1 / 0.81, 0.01);
  EXPECT_NEAR(ratio("sensor.crosstalk", {{"crosstalk_fraction", 0.05}}), 1, 1e-9);
  EXPECT_NEAR(ratio("time.exposure_offset", {{"exposure_offset_s", 1e-3}}), 1.2, 1e-9);
  // Fluorescence adds its fraction, without speckle; 1 %: halves of the point spread lie outside.
  EXPECT_NEAR(ratio("surface.fluorescence", {{"fluorescence_relative", 0.2}}), 1.2, 0.01);
}

}  // namespace
}  // namespace sightline
