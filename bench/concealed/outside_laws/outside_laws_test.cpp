// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/outside_laws/outside_laws.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "bench/concealed/rig_design.h"
#include "bench/concealed/variant_laws.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"

namespace sightline::bench {
namespace {

using std::numbers::pi;

const Effect& Law(std::string_view name) {
  return *FindOutsideLaw("outside." + std::string(name))->effect;
}

// A recording of a rig in which every law can show: distances off 0.35 m, second of a burst.
FrameSetup FrameOfLaws() {
  RecordingSet set = DrawRig(11, "x", SetSize::kSmall);
  const auto far = std::find_if(set.recordings.begin(), set.recordings.end(),
                                [](const RecordedImage& i) { return i.series == "distance"; });
  far->roi_columns_px = 64;
  far->roi_rows_px = 48;
  far->roi_column_px = 100;
  far->roi_row_px = -24;
  far->line_offset_m = 0;
  FrameSetup frame =
      PlateFrame(set, static_cast<int>(std::distance(set.recordings.begin(), far)), {});
  frame.burst_frame_index = 1;
  frame.timestamp_s = 310;  // no node of the cooler's swing
  frame.lens.focus_distance_m = 0.42;
  return frame;
}

std::vector<double> NullValues(const Effect& effect) {
  std::vector<double> values;
  for (const EffectParameter& p : effect.description().parameters) values.push_back(p.null_value);
  return values;
}

PlateScene SceneWith(std::string_view law, const FrameSetup& frame, std::vector<double> p) {
  PlateScene scene = MakePlateScene(frame);
  Law(law).OnPlate(scene, frame, p);
  return scene;
}

// Across the line at X: power, centroid and standard deviation.
struct Profile {
  double power = 0, centroid = 0, sigma = 0;
};
Profile ProfileAt(const PlateScene& scene, double x_m) {
  constexpr double kStep = 5e-6;
  Profile profile;
  double squares = 0;
  for (int i = -4000; i <= 4000; ++i) {
    const double s = kStep * i, value = scene.laser_irradiance_w_m2(x_m, s) * kStep;
    profile.power += value;
    profile.centroid += s * value;
    squares += s * s * value;
  }
  profile.centroid /= profile.power;
  profile.sigma = std::sqrt(squares / profile.power - profile.centroid * profile.centroid);
  return profile;
}

TEST(OutsideLaws, AreTwentyDividedIntoTwoHalves) {
  ASSERT_EQ(OutsideLaws().size(), 20u);
  EXPECT_EQ(DevelopmentLaws().size(), 10u);
  EXPECT_EQ(SealedLaws().size(), 10u);
  std::set<std::string_view> ids, points;
  for (const std::vector<OutsideLaw>& half : {DevelopmentLaws(), SealedLaws()}) {
    for (const OutsideLaw& law : half) {
      const EffectDescription& description = law.effect->description();
      EXPECT_TRUE(ids.insert(description.id).second) << description.id;
      EXPECT_TRUE(description.id.starts_with("outside."));
      EXPECT_EQ(FindEffect(description.id), nullptr) << description.id;
      EXPECT_FALSE(description.reference.empty()) << description.id;
      points.insert(law.point);
      for (const VariantLaw& variant : VariantLaws()) {
        EXPECT_NE(variant.effect->description().id.substr(8), description.id.substr(8));
      }
      for (const ShapeRange& shape : law.shapes) {
        const auto& parameters = description.parameters;
        const auto found = std::find_if(parameters.begin() + 1, parameters.end(),
                                        [&](const auto& p) { return p.name == shape.parameter; });
        ASSERT_NE(found, parameters.end()) << description.id << " " << shape.parameter;
        EXPECT_LT(shape.low, shape.high);
        EXPECT_GE(shape.low, found->lower) << description.id;
        EXPECT_LE(shape.high, found->upper) << description.id;
      }
    }
  }
  EXPECT_THAT(points,
              ::testing::UnorderedElementsAre("source", "plate", "geometry", "pupil",
                                              "pixel irradiance", "electrons", "readout", "time"));
}

TEST(OutsideLaws, DoNothingAtTheirNullValueAndTheSameBytesBeyond) {
  const FrameSetup frame = FrameOfLaws();
  const auto plain = RenderPlateFrame(frame, {}, nullptr, 2);
  ASSERT_TRUE(plain.ok());
  for (const OutsideLaw& law : OutsideLaws()) {
    const std::string id(law.effect->description().id);
    ActiveEffect active{law.effect, NullValues(*law.effect)};
    const auto rendered = [&](int threads) {
      const auto image = RenderPlateFrame(frame, std::vector{active}, nullptr, threads);
      EXPECT_TRUE(image.ok()) << id;
      return image->raw_dn.values;
    };
    EXPECT_EQ(rendered(2), plain->raw_dn.values) << id;
    const EffectParameter& strength = law.effect->description().parameters[0];
    active.parameters[0] = std::min(strength.upper, strength.null_value + 5 * strength.prior_scale);
    if (id == "outside.dual_gain_step") active.parameters[1] = 0.05;
    // A whole number of shorter line times may be the set exposure itself.
    if (id == "outside.exposure_steps") active.parameters[0] = 0.9 * frame.exposure_time_s;
    const auto strong = rendered(1);
    EXPECT_NE(strong, plain->raw_dn.values) << id;
    EXPECT_EQ(rendered(2), strong) << id;
  }
}

TEST(LensEdgeDiffraction, MovesLightToFringesAndKeepsIt) {
  const FrameSetup frame = FrameOfLaws();
  const double phase = 1.0;
  const PlateScene plain = MakePlateScene(frame);
  const PlateScene scene = SceneWith("lens_edge_diffraction", frame, {phase, 0, 1e-3});
  const auto factor = [&](double x) {
    return scene.laser_irradiance_w_m2(x, frame.plate.line_offset_m) /
           plain.laser_irradiance_w_m2(x, frame.plate.line_offset_m);
  };
  // On the edge both halves add: |(1 + exp(i phi))/2|^2.
  EXPECT_NEAR(factor(0), std::pow(std::cos(phase / 2), 2), 2e-3);
  double sum = 0;
  constexpr int kPlaces = 20000;
  const double unit = frame.plate.laser_distance_m * std::sqrt(frame.laser.wavelength_m / 2e-3);
  for (int i = -kPlaces; i <= kPlaces; ++i) sum += factor(40 * unit * i / kPlaces);
  EXPECT_NEAR(sum / (2 * kPlaces + 1), 1, 4e-3);
}

TEST(LineFocusCurvature, WidensTheEndsAtTheSamePower) {
  const FrameSetup frame = FrameOfLaws();
  const double k = 40, x = 0.06, d = frame.plate.laser_distance_m;
  const PlateScene scene = SceneWith("line_focus_curvature", frame, {k});
  const Profile middle = ProfileAt(scene, 0), end = ProfileAt(scene, x);
  EXPECT_NEAR(end.power / middle.power, 1, 1e-6);
  EXPECT_NEAR(end.sigma / middle.sigma,
              BeamRadius(frame.laser, d + k * x * x / (2 * d)) / BeamRadius(frame.laser, d), 1e-6);
}

TEST(CoherenceLength, LosesContrastWithTheFNumber) {
  FrameSetup frame = FrameOfLaws();
  const auto modes = [&](double f_number) {
    frame.lens.f_number = f_number;
    SpeckleModel speckle;
    Law("coherence_length").OnSpeckle(speckle, frame, std::vector{5000.0});
    double squares = 0;
    for (const double w : speckle.pattern_weights) squares += w * w;
    return 1 / squares;
  };
  const double low = modes(4), high = modes(16);
  // M^2 - 1 grows with the square of the f-number.
  EXPECT_GT(low, 1.01);
  EXPECT_NEAR((high * high - 1) / (low * low - 1), 16, 1e-6);
}

TEST(LineKink, BendsBothSidesTheSameWay) {
  const FrameSetup frame = FrameOfLaws();
  const PlateScene scene = SceneWith("line_kink", frame, {0.02, 0});
  const double middle = ProfileAt(scene, 0).centroid;
  EXPECT_NEAR(ProfileAt(scene, 0.01).centroid - middle, 2e-4, 1e-8);
  EXPECT_NEAR(ProfileAt(scene, -0.02).centroid - middle, 4e-4, 1e-8);
}

TEST(PlateWaviness, ShiftsTheLineByHeightTimesTangent) {
  const FrameSetup frame = FrameOfLaws();
  const double height = 3e-4, tangent = std::tan(frame.plate.incidence_angle_rad);
  const PlateScene scene = SceneWith("plate_waviness", frame, {height, 0.02, 0});
  const double middle = ProfileAt(scene, 0).centroid;
  EXPECT_NEAR(ProfileAt(scene, 0.005).centroid - middle, height * tangent, 1e-8);
  EXPECT_NEAR(ProfileAt(scene, -0.005).centroid - middle, -height * tangent, 1e-8);
  EXPECT_NEAR(scene.height_m(0.005, 0), height, 1e-12);
}

TEST(Bleaching, DarkensWhatWasExposedBefore) {
  FrameSetup frame = FrameOfLaws();
  const double fresh = MakePlateScene(frame).brdf_per_sr(0, 0);
  for (const int before : {0, 1, 4}) {
    frame.burst_frame_index = before;
    EXPECT_NEAR(SceneWith("bleaching", frame, {0.1}).brdf_per_sr(0, 0) / fresh,
                1 / (1 + 0.1 * before), 1e-12);
  }
}

TEST(ObliqueSubsurface, ShiftsTheCentroidAndKeepsTheLight) {
  const FrameSetup frame = FrameOfLaws();
  const Profile plain = ProfileAt(MakePlateScene(frame), 0);
  const Profile spread = ProfileAt(SceneWith("oblique_subsurface", frame, {0.3, 5e-4, 3e-4}), 0);
  EXPECT_NEAR(spread.power / plain.power, 1, 1e-6);
  EXPECT_NEAR(spread.centroid - plain.centroid, 0.3 * 5e-4, 1e-7);
  EXPECT_GT(spread.sigma, plain.sigma);
}

TEST(PupilDeposit, TakesLightWithTheSquareOfTheFNumber) {
  FrameSetup frame = FrameOfLaws();
  for (const double f_number : {2.0, 8.0}) {
    frame.lens.f_number = f_number;
    const Pupil pupil =
        MakeOpticsModel(frame, std::vector<ActiveEffect>{{&Law("pupil_deposit"), {3e-4}}})
            .pupil(0, 0);
    const double radius = frame.PupilDiameter() / 2;
    EXPECT_NEAR(1 - ClearFraction(pupil), std::pow(3e-4 / radius, 2), 1e-4) << f_number;
  }
}

TEST(MountTrefoil, HasThreeLeavesAndFallsWithTheThirdPowerOfTheStop) {
  FrameSetup frame = FrameOfLaws();
  frame.lens.f_number = 4;
  const auto error = [&](double x, double y) {
    return MakeOpticsModel(frame, std::vector<ActiveEffect>{{&Law("mount_trefoil"), {0.5}}})
        .pupil(0, 0)
        .WavefrontError(x, y);
  };
  const double r = 4e-4;
  const auto at = [&](double angle) { return error(r * std::cos(angle), r * std::sin(angle)); };
  EXPECT_NEAR(at(pi / 6), 0.5 * frame.laser.wavelength_m * std::sqrt(8) * std::pow(r / 2e-3, 3),
              1e-12);
  EXPECT_NEAR(at(pi / 6 + 2 * pi / 3), at(pi / 6), 1e-15);
  EXPECT_NEAR(at(pi / 6 + pi / 3), -at(pi / 6), 1e-15);
  // At the same place a smaller stop changes nothing: the glass is the same.
  const double wide_open = at(pi / 6);
  frame.lens.f_number = 8;
  EXPECT_NEAR(at(pi / 6), wide_open, 1e-15);
}

TEST(FocusBreathing, ScalesTheImageWithTheFocus) {
  FrameSetup frame = FrameOfLaws();
  frame.lens.focus_distance_m = 0.35;
  EXPECT_FALSE(SceneWith("focus_breathing", frame, {0.1}).image_mapping);
  frame.lens.focus_distance_m = 0.25;
  const PlateScene scene = SceneWith("focus_breathing", frame, {0.1});
  // The image is 4 % larger: a place on the sensor was 4 % nearer to the axis.
  EXPECT_NEAR(scene.image_mapping({1e-3, 2e-3}).v_m, 2e-3 / 1.04, 1e-12);
}

TEST(ThermalFocusDrift, StartsAtNothingAndEndsAtItsShare) {
  FrameSetup frame = FrameOfLaws();
  for (const auto& [time, share] : {std::pair{0.0, 0.0}, {100.0, 1 - std::exp(-1)}, {1e5, 1.0}}) {
    FrameSetup after = frame;
    after.timestamp_s = time;
    Law("thermal_focus_drift").OnFrame(after, std::vector{0.05, 100.0});
    EXPECT_NEAR(*after.lens.focus_distance_m, *frame.lens.focus_distance_m * (1 + 0.05 * share),
                1e-12);
  }
}

TEST(StitchedBlocks, ChangeLightInStepsWithoutAPeriod) {
  PixelIrradiance light;
  light.roi = {-150, -1, 300, 2};
  light.laser_irradiance_w_m2 = Image<float>(300, 2);
  for (float& v : light.laser_irradiance_w_m2.values) v = 1;
  Law("stitched_blocks").OnPixelIrradiance(light, FrameOfLaws(), std::vector{0.02, 20.0});
  std::vector<int> seams;
  for (int j = 0; j < 300; ++j) {
    const float v = light.laser_irradiance_w_m2.At(0, j);
    EXPECT_EQ(v, light.laser_irradiance_w_m2.At(1, j));
    EXPECT_NEAR(std::abs(v - 1.0), 0.02, 1e-6);
    if (j > 0 && v != light.laser_irradiance_w_m2.At(0, j - 1)) seams.push_back(j - 150);
  }
  std::set<int> lengths;
  for (size_t i = 0; i < seams.size(); ++i) {
    EXPECT_EQ((seams[i] + 210) % 20, 0) << seams[i];  // half a block off the principal point
    if (i > 0) lengths.insert(seams[i] - seams[i - 1]);
  }
  EXPECT_THAT(lengths, ::testing::ElementsAre(20, 40));
}

Image<double> Level(int columns, int rows, double electrons) {
  Image<double> image(columns, rows);
  for (double& e : image.values) e = electrons;
  return image;
}

TEST(ColumnSlew, LeavesATailThatFallsLinearly) {
  const FrameSetup frame = FrameOfLaws();
  const double full = frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
  Image<double> image = Level(2, 30, 0);
  image.At(5, 1) = 0.5 * full;
  Law("column_slew").OnElectrons(image, frame, std::vector{40.0});
  for (int i = 0; i < 30; ++i) {
    EXPECT_EQ(image.At(i, 0), 0);
    const double tail = i < 5 ? 0 : std::max(0.0, 0.5 - (i - 5) / 40.0);
    EXPECT_NEAR(image.At(i, 1), tail * full, 1e-9 * full) << i;
  }
}

TEST(DualGainStep, ActsAboveTheThresholdOnly) {
  const FrameSetup frame = FrameOfLaws();
  const double threshold = 0.3 * frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
  Image<double> image = Level(2, 1, 0.99 * threshold);
  image.At(0, 1) = 1.01 * threshold;
  Law("dual_gain_step").OnElectrons(image, frame, std::vector{-0.1, 0.3});
  EXPECT_EQ(image.At(0, 0), 0.99 * threshold);
  EXPECT_NEAR(image.At(0, 1), 0.9 * 1.01 * threshold, 1e-9);
}

TEST(ClampDroop, LeavesAFadingShadowBelowTheLine) {
  const FrameSetup frame = FrameOfLaws();
  Image<double> image = Level(4, 12, 0);
  for (int j = 0; j < 4; ++j) image.At(3, j) = 1000;
  Law("clamp_droop").OnElectrons(image, frame, std::vector{0.1, 5.0});
  EXPECT_EQ(image.At(2, 0), 0);
  EXPECT_EQ(image.At(3, 0), 1000);
  EXPECT_NEAR(image.At(4, 1), -0.1 * 1000 / 5, 1e-9);
  for (int i = 5; i < 12; ++i) EXPECT_NEAR(image.At(i, 1) / image.At(i - 1, 1), 0.8, 1e-9);
}

TEST(SarBitWeight, JumpsWhereItsBitTurns) {
  const FrameSetup frame = FrameOfLaws();
  const Sensor& sensor = frame.sensor;
  // The bit below the highest one: set in the second and in the last quarter.
  const double quarter = std::exp2(sensor.bit_depth_bit - 2);
  for (const auto& [share, error] : {std::pair{0.9, 0}, {1.1, 3}, {1.9, 3}, {2.1, 0}, {3.1, 3}}) {
    const double e = (share * quarter - sensor.black_level_dn) / sensor.gain_dn_per_electron;
    Image<double> image = Level(1, 1, e);
    Law("sar_bit_weight").OnElectrons(image, frame, std::vector{3.0, 1.0});
    EXPECT_NEAR((image.At(0, 0) - e) * sensor.gain_dn_per_electron, error, 1e-6) << share;
  }
}

TEST(CoolerCycle, SwingsWithItsPeriod) {
  const FrameSetup frame = FrameOfLaws();
  for (const auto& [time, swing] : {std::pair{0.0, 7.0}, {30.0, -7.0}, {60.0, 7.0}, {75.0, 0.0}}) {
    FrameSetup after = frame;
    after.timestamp_s = time;
    Law("cooler_cycle").OnFrame(after, std::vector{7.0, 60.0, 0.0});
    EXPECT_NEAR(after.sensor.dark_mean_electrons - frame.sensor.dark_mean_electrons, swing, 1e-9);
  }
}

TEST(GuidewayRoll, TurnsTheOtherWayOnTheOtherSide) {
  FrameSetup frame = FrameOfLaws();
  const auto turned = [&](double distance) {
    frame.plate.camera_distance_m = distance;
    return SceneWith("guideway_roll", frame, {20}).image_mapping({1e-3, 0}).v_m;
  };
  EXPECT_NEAR(turned(0.45), -1e-3 * std::sin(2 * pi / 180), 1e-12);
  EXPECT_NEAR(turned(0.25), 1e-3 * std::sin(2 * pi / 180), 1e-12);
}

TEST(StageSettling, BlursTheFirstFramesAndKeepsTheLight) {
  FrameSetup frame = FrameOfLaws();
  const auto transfer = [&](int index, double q) {
    frame.burst_frame_index = index;
    OpticsModel optics;
    Law("stage_settling").OnOptics(optics, frame, std::vector{1e-5, 0.2});
    return optics.transfer.at(0)(0, q).real();
  };
  EXPECT_EQ(transfer(0, 0), 1);
  EXPECT_NEAR(transfer(0, 2.404826 / (2 * pi * 1e-5)), 0, 1e-6);  // first zero of J_0
  // After each frame the swing is 1/e of what it was.
  EXPECT_NEAR(transfer(1, 1e4 * std::exp(1)), transfer(0, 1e4), 1e-12);
  EXPECT_GT(transfer(1, 1e4), transfer(0, 1e4));
}

TEST(ExposureSteps, RoundsToWholeLineTimes) {
  const double line = 1e-4;
  for (const double set_s : {2e-5, 1.4e-4, 1.6e-4, 3.33e-3}) {
    FrameSetup frame = FrameOfLaws();
    frame.exposure_time_s = set_s;
    Law("exposure_steps").OnFrame(frame, std::vector{line});
    const double lines = frame.exposure_time_s / line;
    EXPECT_NEAR(lines, std::round(lines), 1e-9);
    EXPECT_GE(lines, 1);
    if (set_s > line) {
      EXPECT_LE(std::abs(frame.exposure_time_s - set_s), line / 2 + 1e-12);
    }
  }
}

}  // namespace
}  // namespace sightline::bench
