// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "bench/concealed/effect_draw.h"
#include "bench/concealed/equivalents.h"
#include "bench/concealed/rig_design.h"
#include "bench/concealed/variant_laws.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"
#include "render_worker/recordings/recorded_set.h"

namespace sightline::bench {
namespace {

std::vector<const Effect*> AllDrawn() {
  std::vector<const Effect*> effects = VocabularyEffects();
  for (const VariantLaw& law : VariantLaws()) effects.push_back(law.effect);
  return effects;
}

TEST(RigDesign, IsAValidSetOfEverySize) {
  std::set<double> pitches;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    const SetSize size = seed % 4 == 0 ? SetSize::kFull : SetSize::kSmall;
    const RecordingSet set = DrawRig(seed, "x", size);
    pitches.insert(set.camera.pixel_pitch_m);
    const auto parsed = ParseRecordings(RecordingsToProto(set), "set");
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    EXPECT_THAT(set.recordings.size(),
                size == SetSize::kFull ? ::testing::AllOf(::testing::Ge(40u), ::testing::Le(50u))
                                       : ::testing::AllOf(::testing::Ge(11u), ::testing::Le(14u)));
    std::set<std::string> series;
    for (size_t i = 0; i < set.recordings.size(); ++i) {
      const RecordedImage& image = set.recordings[i];
      series.insert(image.series);
      EXPECT_GT(image.exposure_time_s, 1e-6);
      EXPECT_LT(image.exposure_time_s, 2);
      if (i > 0) {
        EXPECT_GT(image.timestamp_s, set.recordings[i - 1].timestamp_s);
      }
      if (image.kind == RecordingKind::kDark) continue;
      // The line runs through the middle of the region, rounding of its offset apart.
      const FrameSetup frame = PlateFrame(set, static_cast<int>(i), {});
      const double magnification = frame.ImageDistance() / frame.plate.camera_distance_m;
      const double row = magnification * image.line_offset_m / set.camera.pixel_pitch_m;
      EXPECT_NEAR(row, image.roi_row_px + image.roi_rows_px / 2.0, 5);
      // Bayer cells are not cut.
      EXPECT_EQ((set.camera.columns_px / 2 + image.roi_column_px) % 2, 0);
      EXPECT_EQ((set.camera.rows_px / 2 + image.roi_row_px) % 2, 0);
    }
    EXPECT_THAT(series, ::testing::IsSupersetOf(
                            {"aperture", "dark", "distance", "exposure_sweep", "field", "noise"}));
  }
  EXPECT_GE(pitches.size(), 3u);
  EXPECT_EQ(RecordingsToJson(RecordingsToProto(DrawRig(5, "x", SetSize::kSmall))),
            RecordingsToJson(RecordingsToProto(DrawRig(5, "x", SetSize::kSmall))));
}

TEST(RigDesign, ExposuresPutTheCrestToAThirdOfFullScale) {
  const RecordingSet set = DrawRig(3, "x", SetSize::kSmall);
  const double full = set.camera.largest_dn();
  for (size_t i = 0; i < set.recordings.size(); ++i) {
    if (set.recordings[i].series != "noise") continue;
    PlateFrameOptions options;
    options.speckle = false;
    const auto image =
        RenderPlateFrame(PlateFrame(set, static_cast<int>(i), options), {}, nullptr, 1);
    ASSERT_TRUE(image.ok());
    const uint16_t brightest =
        *std::max_element(image->raw_dn.values.begin(), image->raw_dn.values.end());
    // Crest shares of 0.2 to 0.35 times 0.8 to 1.25, with noise on top.
    EXPECT_GT(brightest, 0.15 * full);
    EXPECT_LT(brightest, 0.6 * full);
  }
}

TEST(RigDesign, DeviationsAreNormalAndClipped) {
  SetupDeviation uncertainty;
  for (int i = 0; i < kDeviations; ++i) DeviationAt(uncertainty, i) = 1;
  double sum = 0, squares = 0;
  constexpr int kSeeds = 200;
  for (uint64_t seed = 0; seed < kSeeds; ++seed) {
    SetupDeviation deviation = DrawDeviation(uncertainty, seed);
    for (int i = 0; i < kDeviations; ++i) {
      const double x = DeviationAt(deviation, i);
      EXPECT_LE(std::abs(x), 2);
      sum += x;
      squares += x * x;
    }
  }
  // Clipped at 2: mean square 0.9205, variance of the square 1.23.
  const double n = kSeeds * kDeviations;
  EXPECT_NEAR(sum / n, 0, 4.5 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 0.9205, 4.5 * std::sqrt(1.23 / n));
}

TEST(EffectDraw, ParametersStayWithinBoundsAndStrengthsStartAtNothing) {
  const Sensor mono;
  Sensor colour;
  colour.colour_filter = ColourFilter::kBayerRggb;
  for (const Effect* effect : AllDrawn()) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      CounterRandom random(seed, 0);
      const EffectFamily family = DrawFamily(*effect, seed % 2 ? mono : colour, random);
      const auto& parameters = effect->description().parameters;
      EXPECT_GT(family.largest_scale, 0) << effect->description().id;
      for (const double part : {0.0, 0.3, 1.0}) {
        const ActiveEffect active = family.At(part * family.largest_scale);
        for (size_t k = 0; k < parameters.size(); ++k) {
          EXPECT_GE(active.parameters[k], parameters[k].lower) << effect->description().id;
          EXPECT_LE(active.parameters[k], parameters[k].upper) << effect->description().id;
          if (part == 0 && family.direction[k] != 0) {
            EXPECT_EQ(active.parameters[k], parameters[k].null_value);
          }
        }
      }
    }
  }
}

TEST(EffectDraw, ScalesToTheGainWanted) {
  CounterRandom random(7, 0);
  const Effect* effect = FindEffect("sensor.dark_current");
  const EffectFamily family = DrawFamily(*effect, Sensor{}, random);
  // Grows with the square, then saturates: what blurs and clips do.
  const ExpectedGain gain = [](const std::vector<ActiveEffect>& effects) {
    const double x = effects[0].parameters[0] / 3;
    return 1000 * x * x / (1 + x * x);
  };
  for (const double target : {5.0, 20.0, 100.0}) {
    const ScaledEffect scaled = ScaleToGain(family, gain, target);
    EXPECT_TRUE(scaled.reached);
    EXPECT_NEAR(std::log(scaled.gain / target), 0, 0.05);
    EXPECT_EQ(scaled.gain, gain({scaled.effect}));
  }
  // Out of reach: the largest strength.
  const ScaledEffect least = ScaleToGain(
      family, [](const std::vector<ActiveEffect>&) { return 1.0; }, 20);
  EXPECT_FALSE(least.reached);
  EXPECT_EQ(least.gain, 1);
}

TEST(EffectDraw, StepsOfWholeNumbersAndUnseenEffects) {
  CounterRandom random(7, 0);
  const EffectFamily bits = DrawFamily(*FindEffect("sensor.adc_missing_bits"), Sensor{}, random);
  const ScaledEffect scaled = ScaleToGain(
      bits,
      [](const std::vector<ActiveEffect>& effects) {
        return std::pow(4, effects[0].parameters[0]) - 1;
      },
      20);
  EXPECT_EQ(scaled.effect.parameters[0], 2);  // 15 is nearer than 63
  const ScaledEffect unseen = ScaleToGain(
      bits, [](const std::vector<ActiveEffect>&) { return 0.0; }, 20);
  EXPECT_FALSE(unseen.gain_known);
  EXPECT_GT(unseen.effect.parameters[0], 0);
}

TEST(PhysicallyEquivalent, ProductsAreEquivalentByPhysics) {
  const ActiveEffect albedo = {FindEffect("surface.albedo_error"), {1.3}};
  EXPECT_THAT(PhysicallyEquivalent(albedo, Sensor{}),
              ::testing::UnorderedElementsAre("illumination.power_error",
                                              "optics.transmission_error", "sensor.qe_error"));
  Sensor colour;
  colour.colour_filter = ColourFilter::kBayerRggb;
  const ActiveEffect efficiency = {FindEffect("sensor.qe_error"), {1.3, 0.8, 1.1}};
  EXPECT_TRUE(PhysicallyEquivalent(efficiency, colour).empty());
}

FrameSetup SmallFrame(RecordingSet& set, size_t index) {
  RecordedImage& image = set.recordings[index];
  image.roi_columns_px = 64;
  image.roi_rows_px = 48;
  image.roi_column_px = 100;
  image.roi_row_px = -24;
  image.line_offset_m = 0;
  return PlateFrame(set, static_cast<int>(index), {});
}

TEST(VariantLaws, DoNothingAtTheirNullValueAndSomethingBeyond) {
  RecordingSet set = DrawRig(11, "x", SetSize::kSmall);
  const auto far = std::find_if(set.recordings.begin(), set.recordings.end(),
                                [](const RecordedImage& i) { return i.series == "distance"; });
  ASSERT_NE(far, set.recordings.end());
  const FrameSetup frame =
      SmallFrame(set, static_cast<size_t>(std::distance(set.recordings.begin(), far)));
  const auto plain = RenderPlateFrame(frame, {}, nullptr, 1);
  ASSERT_TRUE(plain.ok());
  ASSERT_GE(VariantLaws().size(), 8u);
  for (const VariantLaw& law : VariantLaws()) {
    const std::string id(law.effect->description().id);
    EXPECT_EQ(FindEffect(id), nullptr) << id << " is in the vocabulary";
    ActiveEffect active{law.effect, {}};
    for (const EffectParameter& parameter : law.effect->description().parameters) {
      active.parameters.push_back(parameter.null_value);
    }
    const std::vector<ActiveEffect> nothing = {active};
    const auto same = RenderPlateFrame(frame, nothing, nullptr, 1);
    ASSERT_TRUE(same.ok());
    EXPECT_EQ(same->raw_dn.values, plain->raw_dn.values) << id;
    const EffectParameter& strength = law.effect->description().parameters[0];
    active.parameters[0] = std::min(strength.upper, strength.null_value + 5 * strength.prior_scale);
    if (id == "variant.power_step") active.parameters[1] = 0;
    const std::vector<ActiveEffect> something = {active};
    const auto other = RenderPlateFrame(frame, something, nullptr, 1);
    ASSERT_TRUE(other.ok());
    EXPECT_NE(other->raw_dn.values, plain->raw_dn.values) << id;
  }
}

TEST(VariantLaws, HalosAndProfilesKeepTheLight) {
  const RecordingSet set = DrawRig(11, "x", SetSize::kSmall);
  const FrameSetup frame = PlateFrame(set, 0, {});
  for (const VariantLaw& law : VariantLaws()) {
    const std::string id(law.effect->description().id);
    ActiveEffect active{law.effect, {}};
    for (const EffectParameter& parameter : law.effect->description().parameters) {
      active.parameters.push_back(parameter.null_value);
    }
    active.parameters[0] = 0.4;
    OpticsModel optics;
    law.effect->OnOptics(optics, frame, active.parameters);
    for (const TransferFunction& transfer : optics.transfer) {
      EXPECT_NEAR(std::abs(transfer(0, 0)), 1, 1e-12) << id;
      EXPECT_LT(std::abs(transfer(0, 3e4)), 1) << id;
    }
    if (id != "variant.beam_side_lobes" && id != "variant.beam_pedestal" &&
        id != "variant.gaussian_scattering") {
      continue;
    }
    const auto integral = [](const PlateScene& scene) {
      double sum = 0;  // the profile is smooth and ends within: the sum is exact
      for (int i = -4000; i <= 4000; ++i) sum += scene.laser_irradiance_w_m2(0, 1e-5 * i);
      return sum;
    };
    PlateScene scene = MakePlateScene(frame);
    const double before = integral(scene);
    law.effect->OnPlate(scene, frame, active.parameters);
    EXPECT_NEAR(integral(scene) / before, 1, 1e-9) << id;
  }
}

}  // namespace
}  // namespace sightline::bench
