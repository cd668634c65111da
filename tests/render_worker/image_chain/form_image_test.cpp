// SPDX-License-Identifier: Apache-2.0
#include "render_worker/image_chain/form_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "render_worker/sensor/expose.h"

namespace sightline {
namespace {

using std::numbers::pi;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

FrameSetup Frame() {
  FrameSetup frame;
  frame.sensor.quantum_efficiency[0] = {{661e-9}, {0.53}};
  frame.sensor.dark_mean_electrons = 27;
  frame.sensor.dark_noise_electrons = 6;
  frame.lens.f_number = 11;
  frame.lens.focus_distance_m = 0.331;
  frame.laser.power_w = 0.58e-3;
  frame.laser.divergence_rad = 1.05e-3;
  frame.laser.beam_focus_distance_m = 0.44;
  frame.laser.fan_angle_rad = 0.64;
  frame.plate = {0.331, 0.416, pi / 4, 0};
  frame.exposure_time_s = 4e-3;
  frame.roi = {-24, -20, 48, 40};
  frame.seeds = {11, 12, 13, 14};
  return frame;
}

// Writes down what is called, and changes things on its way so that the order shows in the numbers.
class Recorder : public Effect {
 public:
  explicit Recorder(std::vector<std::string>& calls) : calls_(calls) {
    description_.id = "test.recorder";
  }
  const EffectDescription& description() const override { return description_; }
  void OnFrame(FrameSetup& frame, Parameters parameters) const override {
    calls_.push_back("frame");
    frame.laser.power_w *= parameters[0];
  }
  void OnPlate(PlateScene&, const FrameSetup& frame, Parameters) const override {
    calls_.push_back("plate");
    power_w_ = frame.laser.power_w;
  }
  void OnIdealImage(IdealImage&, const FrameSetup&, Parameters) const override {
    calls_.push_back("ideal");
  }
  void OnOptics(OpticsModel&, const FrameSetup&, Parameters) const override {
    if (calls_.empty() || calls_.back() != "optics") calls_.push_back("optics");
  }
  void OnSpeckle(SpeckleModel&, const FrameSetup&, Parameters) const override {
    calls_.push_back("speckle");
  }
  void OnPixelIrradiance(PixelIrradiance&, const FrameSetup&, Parameters) const override {
    calls_.push_back("pixels");
  }
  void OnMeanElectrons(Image<double>& mean, const Image<double>* previous, const FrameSetup&,
                       Parameters) const override {
    calls_.push_back(previous == nullptr ? "mean" : "mean after previous");
    for (double& value : mean.values) value += 1000;
  }
  void OnElectrons(Image<double>& electrons, const FrameSetup&, Parameters) const override {
    calls_.push_back("electrons");
    for (double& value : electrons.values) value = std::max(value, 500.0);
  }
  void OnRaw(Image<uint16_t>& raw, const FrameSetup&, Parameters) const override {
    calls_.push_back("raw");
    raw.At(0, 0) = 4242;
  }

  mutable double power_w_ = 0;

 private:
  std::vector<std::string>& calls_;
  EffectDescription description_;
};

TEST(ImageChain, HooksAreCalledInTheOrderOfTheChain) {
  std::vector<std::string> calls;
  const Recorder recorder(calls);
  const std::vector<ActiveEffect> effects = {{&recorder, {2.0}}};
  const Image<double> previous(48, 40);
  const auto formed = RenderPlateFrame(Frame(), effects, &previous, 1);
  ASSERT_TRUE(formed.ok()) << formed.status();
  EXPECT_THAT(calls, ElementsAre("frame", "plate", "optics", "ideal", "optics", "speckle", "pixels",
                                 "mean after previous", "electrons", "raw"));
  EXPECT_DOUBLE_EQ(recorder.power_w_, 2 * Frame().laser.power_w);
  EXPECT_EQ(formed->raw_dn.At(0, 0), 4242);
  for (const double value : formed->mean_photo_electrons.values) EXPECT_GE(value, 1000);
}

TEST(ImageChain, SameBytesForAnyNumberOfThreads) {
  const auto one = RenderPlateFrame(Frame(), {}, nullptr, 1);
  const auto three = RenderPlateFrame(Frame(), {}, nullptr, 3);
  ASSERT_TRUE(one.ok() && three.ok());
  EXPECT_EQ(one->raw_dn, three->raw_dn);
}

TEST(ImageChain, SpeckleBelongsToThePlateAndNoiseToTheFrame) {
  FrameSetup frame = Frame();
  const auto first = RenderPlateFrame(frame, {}, nullptr, 2);
  frame.seeds.noise += 1;
  const auto other_noise = RenderPlateFrame(frame, {}, nullptr, 2);
  frame.seeds.speckle += 1;
  const auto other_place = RenderPlateFrame(frame, {}, nullptr, 2);
  ASSERT_TRUE(first.ok() && other_noise.ok() && other_place.ok());
  EXPECT_EQ(first->light.laser_irradiance_w_m2, other_noise->light.laser_irradiance_w_m2);
  EXPECT_NE(first->raw_dn, other_noise->raw_dn);
  EXPECT_NE(first->light.laser_irradiance_w_m2, other_place->light.laser_irradiance_w_m2);
}

TEST(ImageChain, ElectronsOfTheWholeLineInClosedForm) {
  // Without speckle: column sum of mean electrons = eta p^2 t lambda/(hc) times the line's light.
  FrameSetup frame = Frame();
  frame.speckle = false;
  frame.roi = {-24, -250, 48, 500};
  const auto formed = RenderPlateFrame(frame, {}, nullptr, 2);
  ASSERT_TRUE(formed.ok());
  double sum = 0;
  for (int i = 0; i < 500; ++i) sum += formed->mean_photo_electrons.At(i, 24);
  const double b = frame.ImageDistance();
  const double p = frame.sensor.pixel_pitch_m;
  const double length = 2 * 0.416 * std::tan(frame.laser.fan_angle_rad / 2);
  const double light = pi / 4 * frame.lens.transmission * std::pow(frame.PupilDiameter() / b, 2) *
                       PlateBrdf(frame.surface, pi / 4) * frame.laser.power_w / length * b / 0.331;
  const double expected =
      light / p * 0.53 * p * p * frame.exposure_time_s * 661e-9 / (6.62607015e-34 * 299792458);
  // Beyond 250 px and from beyond the margin, together less than 1/(pi^2 q_c 250) + 1e-3; the
  // cut-off q_c is 0.35 cycles per pixel.
  EXPECT_NEAR(sum / expected, 1, 1 / (pi * pi * 0.35 * 250) + 1e-3);
  EXPECT_LT(sum, expected * 1.0001);
}

TEST(ImageChain, DarkFramesHaveNoLight) {
  FrameSetup frame = Frame();
  frame.shutter_open = false;
  const auto dark = RenderPlateFrame(frame, {}, nullptr, 1);
  ASSERT_TRUE(dark.ok());
  for (const double value : dark->mean_photo_electrons.values) EXPECT_EQ(value, 0);
  frame.shutter_open = true;
  frame.laser_on = false;
  const auto off = RenderPlateFrame(frame, {}, nullptr, 1);
  ASSERT_TRUE(off.ok());
  EXPECT_EQ(off->raw_dn, dark->raw_dn);
}

TEST(ImageChain, CoarseGridIsAnError) {
  FrameSetup frame = Frame();
  frame.lens.f_number = 2;
  IdealImage image;
  image.grid = {frame.roi, 3, 0, frame.sensor.pixel_pitch_m};
  image.laser_irradiance_w_m2 = Image<float>(image.grid.columns(), image.grid.rows());
  image.constant_depth_m = 0.331;
  const auto formed = FormImage(image, frame, {}, SpeckleModel(), nullptr, 1);
  EXPECT_EQ(formed.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(formed.status().message()), HasSubstr("sub_pixels: 3"));
  EXPECT_THAT(std::string(formed.status().message()), HasSubstr("at least 8"));
}

TEST(ImageChain, MoreSubPixelsGiveTheSamePicture) {
  // Statistics only, as scatterers differ: the mean without speckle does not depend on the grid.
  FrameSetup frame = Frame();
  frame.speckle = false;
  const auto coarse = RenderPlateFrame(frame, {}, nullptr, 2);
  frame.sub_pixels = 5;
  const auto fine = RenderPlateFrame(frame, {}, nullptr, 2);
  ASSERT_TRUE(coarse.ok() && fine.ok());
  for (int i = 0; i < 40; ++i) {
    // Both grids resolve the line; the pupil's rim is sampled by the same frequencies.
    EXPECT_NEAR(coarse->mean_photo_electrons.At(i, 10), fine->mean_photo_electrons.At(i, 10),
                2e-3 * coarse->mean_photo_electrons.At(20, 10));
  }
}

}  // namespace
}  // namespace sightline
