// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/lens_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "core/rig/scheimpflug.h"
#include "render_worker/optics/circle_of_confusion.h"
#include "tests/render_worker/optical_planning/step_scene.h"

namespace sightline {
namespace {

double Sum(const Image<float>& image) {
  return std::accumulate(image.values.begin(), image.values.end(), 0.0);
}

// Root mean square of the difference over the root mean square of the reference.
double RelativeDifference(const Image<float>& image, const Image<float>& reference) {
  double difference = 0, squares = 0;
  for (size_t i = 0; i < reference.values.size(); ++i) {
    difference += std::pow(image.values[i] - reference.values[i], 2);
    squares += std::pow(reference.values[i], 2);
  }
  return std::sqrt(difference / squares);
}

struct Setting {
  double f_number, focus_m;
  double tilt_x_deg, tilt_y_deg;
};
class AgainstTheRenderer : public ::testing::TestWithParam<Setting> {};

// The light on the pixels is that of the renderer, which traces every f-number anew and samples the
// pupil of other light: in focus and out of it, with the lens wide open and stopped down.
TEST_P(AgainstTheRenderer, ImagesAreTheSame) {
  const auto [f_number, focus_m, tilt_x_deg, tilt_y_deg] = GetParam();
  StepOptions step;
  step.lens = absl::StrCat(R"("f_number": )", f_number, R"(, "focus_distance_m": )", focus_m,
                           R"(, "sensor_tilt_x_deg": )", tilt_x_deg, R"(, "sensor_tilt_y_deg": )",
                           tilt_y_deg);
  step.ambient_w_m2_sr = 1;
  step.speckle = false;
  const auto scene = StepScene(step);
  const PartFrameRequest request = StepFrame();
  const FrameSetup frame = PartFrameSetup(scene->inspection(), request);
  FrameLightOptions options;
  options.limits = TwoThreads();
  options.margin_px = LensMarginPx(frame, {}, std::vector<double>{0.29, 0.31});
  auto light = TraceFrameLight(*scene, request, {}, options);
  ASSERT_TRUE(light.ok()) << light.status();
  const std::vector<uint64_t> seeds = {1};
  auto images = ImageThroughLens(*light, frame, {}, seeds, options.limits);
  ASSERT_TRUE(images.ok()) << images.status();

  // Without speckle: the mean over all patterns.
  auto rendered = RenderPartFrame(*scene, request, {}, false, TwoThreads());
  ASSERT_TRUE(rendered.ok()) << rendered.status();
  const PixelIrradiance& reference = rendered->image.light;
  const PixelIrradiance& image = (*images)[0];
  EXPECT_LT(RelativeDifference(image.laser_irradiance_w_m2, reference.laser_irradiance_w_m2), 0.02);
  EXPECT_NEAR(Sum(image.laser_irradiance_w_m2) / Sum(reference.laser_irradiance_w_m2), 1, 0.01);
  // Other light is noisy in both.
  EXPECT_LT(RelativeDifference(image.incoherent_electron_flux_m2_s[0],
                               reference.incoherent_electron_flux_m2_s[0]),
            0.05);
  EXPECT_NEAR(
      Sum(image.incoherent_electron_flux_m2_s[0]) / Sum(reference.incoherent_electron_flux_m2_s[0]),
      1, 0.01);
}
INSTANTIATE_TEST_SUITE_P(Settings, AgainstTheRenderer,
                         ::testing::Values(Setting{2.8, 0.298, 0, 0}, Setting{2.8, 0.32, 0, 0},
                                           Setting{8, 0.298, 0, 0}, Setting{16, 0.25, 0, 0},
                                           // Tilts that blur one side of the image.
                                           Setting{2, 0.3, 4, 0}, Setting{2, 0.3, 0, -4}));

// Contrast of the speckle on the line follows the same law as in the renderer: more of it at small
// apertures; other seeds, other speckle; same seed, same bytes, whatever the threads.
TEST(LensImage, SpeckleDependsOnSeedAndAperture) {
  const auto scene = StepScene();
  FrameLightOptions options;
  options.limits = TwoThreads();
  auto light = TraceFrameLight(*scene, StepFrame(), {}, options);
  ASSERT_TRUE(light.ok());
  FrameSetup frame = PartFrameSetup(scene->inspection(), StepFrame());
  std::vector<double> roughness;
  for (const double f_number : {2.8, 16.0}) {
    frame.lens.f_number = f_number;
    const std::vector<uint64_t> seeds = {1, 2, 1};
    RenderLimits one = TwoThreads();
    one.threads = 1;
    auto images = ImageThroughLens(*light, frame, {}, seeds, TwoThreads());
    auto alone = ImageThroughLens(*light, frame, {}, seeds, one);
    ASSERT_TRUE(images.ok() && alone.ok());
    EXPECT_EQ((*images)[0].laser_irradiance_w_m2.values, (*images)[2].laser_irradiance_w_m2.values);
    EXPECT_EQ((*images)[1].laser_irradiance_w_m2.values, (*alone)[1].laser_irradiance_w_m2.values);
    EXPECT_GT(
        RelativeDifference((*images)[1].laser_irradiance_w_m2, (*images)[0].laser_irradiance_w_m2),
        0.05);
    roughness.push_back(
        RelativeDifference((*images)[1].laser_irradiance_w_m2, (*images)[0].laser_irradiance_w_m2));
  }
  EXPECT_GT(roughness[1], 1.5 * roughness[0]);
}

// Narrow strips show what the whole image shows: the same speckle, but for light cut off at their
// margins.
TEST(LensImage, StripsFitTogether) {
  const auto scene = StepScene();
  FrameLightOptions options;
  options.limits = TwoThreads();
  auto light = TraceFrameLight(*scene, StepFrame(), {}, options);
  ASSERT_TRUE(light.ok());
  FrameSetup frame = PartFrameSetup(scene->inspection(), StepFrame());
  frame.lens.f_number = 5.6;
  const std::vector<uint64_t> seeds = {1};
  RenderLimits small = TwoThreads();
  small.max_image_bytes = 6 << 20;
  auto strips = ImageThroughLens(*light, frame, {}, seeds, small);
  auto whole = ImageThroughLens(*light, frame, {}, seeds, TwoThreads());
  ASSERT_TRUE(strips.ok()) << strips.status();
  ASSERT_TRUE(whole.ok());
  EXPECT_LT(
      RelativeDifference((*strips)[0].laser_irradiance_w_m2, (*whole)[0].laser_irradiance_w_m2),
      0.03);
  EXPECT_NEAR(Sum((*strips)[0].laser_irradiance_w_m2) / Sum((*whole)[0].laser_irradiance_w_m2), 1,
              0.005);
  small.max_image_bytes = 1 << 16;
  EXPECT_EQ(ImageThroughLens(*light, frame, {}, seeds, small).status().code(),
            absl::StatusCode::kResourceExhausted);
}

// The sensor tilt of Scheimpflug's rule makes the image of the laser line as sharp out of focus as
// in it.
TEST(LensImage, TiltToTheSheetSharpensTheLine) {
  StepOptions step;
  step.height_m = 0.012;
  const auto scene = StepScene(step);
  FrameLightOptions options;
  options.limits = TwoThreads();
  auto light = TraceFrameLight(*scene, StepFrame(), {}, options);
  ASSERT_TRUE(light.ok());
  FrameSetup frame = PartFrameSetup(scene->inspection(), StepFrame());
  frame.speckle = false;
  frame.lens.f_number = 1.4;
  const double f = frame.lens.focal_length_m;
  const auto plane = ScheimpflugPlane(light->sheet_normal, light->sheet_offset_m, f);
  ASSERT_TRUE(plane.has_value());
  const auto peak = [&](const FrameSetup& setup) {
    const std::vector<uint64_t> seeds = {1};
    auto images = ImageThroughLens(*light, setup, {}, seeds, TwoThreads());
    EXPECT_TRUE(images.ok()) << images.status();
    // Sum over the columns of the brightest pixel: sharp lines are bright.
    double sum = 0;
    const Image<float>& image = (*images)[0].laser_irradiance_w_m2;
    for (int column = 10; column < image.columns_px - 10; ++column) {
      float brightest = 0;
      for (int row = 0; row < image.rows_px; ++row) {
        brightest = std::max(brightest, image.At(row, column));
      }
      sum += brightest;
    }
    return sum;
  };
  FrameSetup tilted = frame;
  tilted.lens.focus_distance_m = 1 / (1 / f - 1 / plane->image_distance_m);
  tilted.lens.sensor_tilt_x_rad = std::atan(plane->slope_v);
  tilted.lens.sensor_tilt_y_rad = std::atan(plane->slope_u);
  const double sharp = peak(tilted);
  // Two planes 12 mm apart: no focus distance suits both.
  double best_untilted = 0;
  for (const double focus_m : {0.292, 0.296, 0.3, 0.304, 0.308}) {
    FrameSetup flat = frame;
    flat.lens.focus_distance_m = focus_m;
    best_untilted = std::max(best_untilted, peak(flat));
  }
  EXPECT_GT(sharp, 1.05 * best_untilted);
  // Tilted the other way it is worse than not at all.
  FrameSetup wrong = tilted;
  wrong.lens.sensor_tilt_x_rad = -tilted.lens.sensor_tilt_x_rad;
  EXPECT_LT(peak(wrong), best_untilted);
}

TEST(CircleOfConfusion, KeepsEnergyAndFillsTheDisc) {
  Image<float> light(41, 41), radii(41, 41);
  light.At(20, 20) = 3;
  std::fill(radii.values.begin(), radii.values.end(), 6.F);
  const Image<float> spread = SpreadByDefocus(light, radii, 2);
  EXPECT_NEAR(Sum(spread), 3, 1e-5);
  double second = 0;
  for (int i = 0; i < 41; ++i) {
    for (int j = 0; j < 41; ++j) {
      second += spread.At(i, j) / 3.0 * (std::pow(i - 20, 2) + std::pow(j - 20, 2));
    }
  }
  // Mean square radius of a disc, R^2/2, and of the pixels' places within it.
  EXPECT_NEAR(second, 18, 0.4);
  EXPECT_NEAR(spread.At(20, 20), 3 / (std::numbers::pi * 36), 2e-4);
}

// Large discs are made of coarser samples: as bright, as wide, and done at once.
TEST(CircleOfConfusion, LargeDiscsKeepEnergyAndWidth) {
  Image<float> light(401, 401), radii(401, 401);
  light.At(200, 200) = 1;
  std::fill(radii.values.begin(), radii.values.end(), 120.F);
  const Image<float> spread = SpreadByDefocus(light, radii, 2);
  EXPECT_NEAR(Sum(spread), 1, 1e-4);
  double second = 0;
  for (int i = 0; i < 401; ++i) {
    for (int j = 0; j < 401; ++j) {
      second += spread.At(i, j) * (std::pow(i - 200, 2) + std::pow(j - 200, 2));
    }
  }
  EXPECT_NEAR(std::sqrt(2 * second), 120, 3);
  EXPECT_NEAR(spread.At(200, 200), 1 / (std::numbers::pi * 120 * 120), 2e-6);
  // Every pixel of a whole sensor, out of all proportion.
  Image<float> all(1920, 1200), far(1920, 1200);
  std::fill(all.values.begin(), all.values.end(), 1.F);
  std::fill(far.values.begin(), far.values.end(), 900.F);
  EXPECT_LE(Sum(SpreadByDefocus(all, far, 2)), Sum(all) * 1.001);
}

TEST(CircleOfConfusion, SmallRadiiChangeNothingAndThreadsDoNotMatter) {
  Image<float> light(50, 70), radii(50, 70);
  for (size_t i = 0; i < light.values.size(); ++i) {
    light.values[i] = static_cast<float>((i * 2654435761U) % 1000) / 1000;
  }
  EXPECT_EQ(SpreadByDefocus(light, radii, 2).values, light.values);
  for (size_t i = 0; i < radii.values.size(); ++i) radii.values[i] = static_cast<float>(i % 5);
  EXPECT_EQ(SpreadByDefocus(light, radii, 1).values, SpreadByDefocus(light, radii, 3).values);
}

}  // namespace
}  // namespace sightline
