// SPDX-License-Identifier: Apache-2.0
// Random effects are distinguished from what all recordings have in common by the variance between
// recordings.
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <map>
#include <memory>
#include <numbers>
#include <string_view>
#include <vector>

#include "render_worker/diagnosis/finding/pictures.h"
#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/random_effect/law/random_effect.h"
#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/selection/compare_models.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

constexpr std::string_view kPowerNoise = "illumination.power_noise";
constexpr std::string_view kExposureJitter = "time.exposure_jitter";
constexpr std::string_view kAlbedoTexture = "surface.albedo_texture";
constexpr std::string_view kVibration = "time.vibration_blur";

// The small set, with repeats of one speckle and more plate positions at short exposures.
RecordingSet Description() {
  RecordingSet set = SmallSetDescription();
  const auto add = [&](double exposure_s, double f_number, int position, int repeat_group) {
    RecordedImage image = set.recordings.front();
    image.timestamp_s = 20.0 * static_cast<double>(set.recordings.size());
    image.exposure_time_s = exposure_s;
    image.f_number = f_number;
    image.same_speckle = position == set.recordings.back().plate_position_id;
    image.plate_position_id = position;
    image.repeat_group = repeat_group;
    set.recordings.push_back(image);
  };
  for (int i = 0; i < 3; ++i) add(1.2e-3, 5.6, 50, 50);
  for (int i = 0; i < 4; ++i) add(3.1e-4, 2.8, 60 + i, 60);
  for (int i = 0; i < 3; ++i) add(2.5e-3, 8, 70 + i, 70);
  return set;
}

RecordedSet Render(const std::vector<ActiveEffect>& effects, uint64_t seed,
                   RecordingSet set = Description()) {
  SetupDeviation deviation;
  deviation.focus_distance_relative = 0.01;
  deviation.power_relative = -0.04;
  deviation.line_position_common_px = 0.8;
  deviation.line_position_each_px = 0.3;
  std::vector<Image<uint16_t>> raw_dn;
  for (size_t i = 0; i < set.recordings.size(); ++i) {
    const FrameSetup frame = PlateFrame(set, static_cast<int>(i), {deviation, seed});
    raw_dn.push_back(RenderPlateFrame(frame, effects, nullptr, 1)->raw_dn);
  }
  return MakeRecordedSet(std::move(set), std::move(raw_dn));
}

struct Compared {
  FitResult null;
  std::vector<RandomEffectCandidate>
      candidates;  // the vocabulary's four effects, then model-discrepancy terms
  const RandomEffectCandidate* best = nullptr;  // of the vocabulary

  const RandomEffectCandidate& Of(std::string_view id) const {
    for (const RandomEffectCandidate& candidate : candidates) {
      if (candidate.effect->description().id == id) return candidate;
    }
    ADD_FAILURE() << id << " was not compared";
    return candidates.front();
  }
};

Compared Compare(const SetModel& model, const std::vector<std::string_view>& terms = {}) {
  std::vector<const Effect*> effects = {FindEffect(kPowerNoise), FindEffect(kExposureJitter),
                                        FindEffect(kAlbedoTexture), FindEffect(kVibration)};
  const size_t known = effects.size();
  for (const std::string_view term : terms) effects.push_back(FindFreeFormTerm(term));
  Compared compared;
  compared.null = FitNull(model);
  compared.candidates = CompareRandomEffects(model, compared.null, effects);
  compared.best = &*std::max_element(
      compared.candidates.begin(), compared.candidates.begin() + static_cast<ptrdiff_t>(known),
      [](const auto& a, const auto& b) { return a.log_evidence < b.log_evidence; });
  return compared;
}

// A set that is recorded with one effect, and how that compares with others. Each case is rendered
// and compared once per program: several tests look at it.
struct EffectCase {
  std::string_view id;
  std::vector<double> parameters;
  uint64_t seed;
  std::vector<std::string_view> terms;  // compared too
};

struct ComparedSet {
  explicit ComparedSet(const EffectCase& of)
      : set(Render({ActiveEffect{FindEffect(of.id), of.parameters}}, of.seed)),
        model(set, {}),
        compared(Compare(model, of.terms)) {}
  const RecordedSet set;
  const SetModel model;
  const Compared compared;
};

const ComparedSet& ComparedOnce(const EffectCase& of) {
  static auto* const known = new std::map<uint64_t, std::unique_ptr<const ComparedSet>>;
  auto& compared = (*known)[of.seed];
  if (compared == nullptr) compared = std::make_unique<const ComparedSet>(of);
  return *compared;
}

const EffectCase& WithPowerNoise() {
  static const EffectCase with{kPowerNoise, {0.06}, 21, {"unknown.power_scatter"}};
  return with;
}
const EffectCase& WithExposureJitter() {
  static const EffectCase with{
      kExposureJitter, {5e-5}, 22, {"unknown.exposure_scatter", "unknown.power_scatter"}};
  return with;
}
const EffectCase& WithTexture() {
  static const EffectCase with{kAlbedoTexture, {0.15, 3e-3}, 23, {"unknown.reflectance_scatter"}};
  return with;
}
const EffectCase& WithVibration() {
  static const EffectCase with{
      kVibration, {1.0, 60}, 24, {"unknown.power_scatter", "unknown.movement"}};
  return with;
}
// Blocks that are half as bright as others, or twice.
const EffectCase& WithStrongTexture() {
  static const EffectCase with{kAlbedoTexture, {0.35, 4e-3}, 27, {}};
  return with;
}

// The planted effect has the largest evidence of the four, its strength is found, and its realised
// values are taken off the residual.
void ExpectFound(const EffectCase& planted) {
  SCOPED_TRACE(planted.id);
  const auto& [set, model, compared] = ComparedOnce(planted);
  ASSERT_EQ(compared.candidates.size(), 4 + planted.terms.size());
  const RandomEffectCandidate& best = *compared.best;
  EXPECT_EQ(best.effect->description().id, planted.id);
  EXPECT_GT(best.log_evidence, 5);
  EXPECT_NEAR(best.parameters[0], planted.parameters[0], 3 * best.standard_errors[0]);
  EXPECT_LT(best.fit.chi_squared, compared.null.chi_squared);
  // The realised values of recordings that are left out are unknown: the prediction contains their
  // variance.
  const BlockSplit split = SplitBlocks(model, HeldOutRecordings(set, 1));
  const PredictedFit before = PredictBlocks(compared.null, split.used, split.held_out);
  const PredictedFit after = PredictBlocks(best.fit, split.used, split.held_out);
  EXPECT_EQ(before.degrees_of_freedom, after.degrees_of_freedom);
  EXPECT_LT(after.chi_squared, before.chi_squared);
}

// Regression: if the black level is off by more than its uncertainty allows, power noise seemed to
// explain it, because the bound of the black level was not active in the fit with the noise.
TEST(CompareRandomEffects, KeepsKnownParametersWithinTheirBounds) {
  const RecordedSet set = Render({{FindEffect("sensor.black_level_error"), {4}}}, 9);
  const SetModel model(set, {});
  const Compared compared = Compare(model);
  const double allowed = 3.001 * set.description.uncertainty.dark_mean_electrons;
  ASSERT_GT(compared.null.parameters.deviations.dark_mean_electrons, 0.99 * allowed);
  for (const RandomEffectCandidate& candidate : compared.candidates) {
    EXPECT_LE(candidate.fit.parameters.deviations.dark_mean_electrons, allowed)
        << candidate.effect->description().id;
    EXPECT_GT(candidate.fit.chi_squared, 0.8 * compared.null.chi_squared)
        << candidate.effect->description().id;
  }
}

// Regression: far from the axis, where another distance moves the line by more than its width, its
// light seemed to be missing, and strong jitter was not found at all.
TEST(LightExcesses, AreThoseOfTheLineWhereverItIs) {
  SetupDeviation deviation;
  deviation.line_position_each_px = 12;
  const RecordedSet set = RenderSmallSet(deviation, {}, 6);
  const SetModel model(set, {});
  for (const double excess : LightExcesses(model, {})) EXPECT_NEAR(excess, 0, 0.12);
}

TEST(CompareRandomEffects, FindsNothingWhereNothingScatters) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    SCOPED_TRACE(seed);
    const RecordedSet set = Render({}, seed);
    const SetModel model(set, {});
    EXPECT_LT(Compare(model).best->log_evidence, 2);
  }
}

TEST(CompareRandomEffects, NamesPowerNoise) { ExpectFound(WithPowerNoise()); }

// Exposures of one speckle determine their ratios so well that power noise makes the null model's
// parameters wrong: these and the realised powers are found in turn.
TEST(CompareRandomEffects, NamesPowerNoiseThatLeadsTheNullModelAstray) {
  RecordingSet description = Description();
  for (const double exposure_s : {1e-3, 4e-2, 1.3e-2, 4.2e-3, 1.3e-3, 0.12, 1.3e-3, 0.12}) {
    RecordedImage image = description.recordings.front();
    image.timestamp_s = 20.0 * static_cast<double>(description.recordings.size());
    image.exposure_time_s = exposure_s;
    image.f_number = 8;
    image.plate_position_id = 90;
    image.same_speckle = exposure_s != 1e-3;
    image.repeat_group = static_cast<int>(description.recordings.size()) + 100;
    description.recordings.push_back(image);
  }
  constexpr double kNoise = 0.1;
  const RecordedSet set =
      Render({ActiveEffect{FindEffect(kPowerNoise), {kNoise}}}, 31, description);
  const SetModel model(set, {});
  const Compared compared = Compare(model);
  EXPECT_GT(compared.null.chi_squared, 2 * compared.null.data_count);
  EXPECT_EQ(compared.best->effect->description().id, kPowerNoise);
  EXPECT_NEAR(compared.best->parameters[0], kNoise, 0.3 * kNoise);
  EXPECT_LT(compared.best->fit.chi_squared, 1.1 * compared.best->fit.data_count);
}

TEST(CompareRandomEffects, NamesExposureJitter) { ExpectFound(WithExposureJitter()); }

TEST(CompareRandomEffects, NamesAlbedoTexture) { ExpectFound(WithTexture()); }

TEST(CompareRandomEffects, NamesVibration) { ExpectFound(WithVibration()); }

// Exposures over parts of a period have skewed and flat distributions of displacements, each by its
// phase. Two of them show the speckle of two places of the line.
TEST(CompareRandomEffects, FollowsThePhasesOfAStrongVibration) {
  constexpr double kAmplitude_px = 3, kFrequency_hz = 230;
  const RecordedSet set =
      Render({ActiveEffect{FindEffect(kVibration), {kAmplitude_px, kFrequency_hz}}}, 32);
  const SetModel model(set, {});
  const Compared compared = Compare(model);
  ASSERT_EQ(compared.best->effect->description().id, kVibration);
  EXPECT_NEAR(compared.best->parameters[0], kAmplitude_px, 0.02 * kAmplitude_px);
  EXPECT_NEAR(compared.best->parameters[1], kFrequency_hz, 0.03 * kFrequency_hz);
  EXPECT_LT(compared.best->standard_errors[0], 0.02 * kAmplitude_px);
  EXPECT_LT(compared.best->fit.chi_squared, 1.1 * compared.best->fit.data_count);
  // Regression: pictures showed the vibration at a mean phase, pixels away from the line that the
  // fit had found. Centres by the light above the dark rows, over the line's rows.
  const auto centre_px = [](const v1::ProfileComparison& profile, const auto& values) {
    const double dark =
        *std::min_element(profile.observed_dn().begin(), profile.observed_dn().end());
    double sum = 0, weighted = 0;
    for (int i = 0; i < profile.row_px_size(); ++i) {
      const double light = std::max(0.0, values[i] - dark - 20);
      sum += light;
      weighted += light * profile.row_px(i);
    }
    return weighted / sum;
  };
  double farthest_px = 0;
  for (const int f : TellingRecordings(model, compared.null, compared.best->fit, 6)) {
    const v1::ProfileComparison profile =
        CompareProfiles(model, compared.null, compared.best->fit, f);
    const double observed_px = centre_px(profile, profile.observed_dn());
    EXPECT_NEAR(centre_px(profile, profile.model_dn()), observed_px, 0.3) << "recording " << f;
    farthest_px =
        std::max(farthest_px, std::abs(centre_px(profile, profile.null_dn()) - observed_px));
  }
  EXPECT_GT(farthest_px, 1);
}

TEST(CompareRandomEffects, FindsAStrongTexturesLength) {
  const Compared& compared = ComparedOnce(WithStrongTexture()).compared;
  const double rms = WithStrongTexture().parameters[0];
  const double length_m = WithStrongTexture().parameters[1];
  ASSERT_EQ(compared.best->effect->description().id, kAlbedoTexture);
  EXPECT_NEAR(compared.best->parameters[0], rms, 0.3 * rms);
  EXPECT_NEAR(compared.best->parameters[1], length_m, 3 * compared.best->standard_errors[1]);
  EXPECT_LT(compared.best->standard_errors[1], 0.4 * length_m);
  EXPECT_LT(compared.best->fit.chi_squared, 1.1 * compared.best->fit.data_count);
}

TEST(CompareRandomEffects, PicturesShowTheLightThatPlacesHaveDrawn) {
  const auto& [set, model, compared] = ComparedOnce(WithStrongTexture());
  double before = 0, after = 0;
  for (const int f : TellingRecordings(model, compared.null, compared.best->fit, 4)) {
    const v1::ProfileComparison profile =
        CompareProfiles(model, compared.null, compared.best->fit, f);
    for (int row = 0; row < profile.row_px_size(); ++row) {
      const double deviation = profile.standard_deviation_dn(row);
      before += std::pow((profile.observed_dn(row) - profile.null_dn(row)) / deviation, 2);
      after += std::pow((profile.observed_dn(row) - profile.model_dn(row)) / deviation, 2);
    }
  }
  EXPECT_LT(after, 0.5 * before);
}

TEST(RealisedReflectance, MakesBlocksOfAPlacesRecordingsBrighter) {
  const RecordedSet set = MakeRecordedSet(Description(), {});
  const SetModel model(set, {});
  const int blocks = model.blocks_along_line();
  Eigen::VectorXd reflectance =
      Eigen::VectorXd::Zero(blocks * static_cast<Eigen::Index>(model.position_ids().size()));
  reflectance[blocks + 1] = 0.2;
  reflectance[blocks + 2] = -0.3;
  const RealisedEffect realised(RealisedReflectance(model, reflectance));
  const ExpectedSet before = model.ExpectStrips({}, false);
  SetParameters with;
  with.effects.push_back({&realised, {}});
  const ExpectedSet after = model.ExpectStrips(with, false);
  const auto light = [](const ExpectedFrame& strip) {
    double sum = 0;
    for (const double electrons : strip.mean_photo_electrons.values) sum += electrons;
    return sum;
  };
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const bool there = set.frames[f].plate_position_id == model.position_ids()[1];
    for (int block = 0; block < blocks; ++block) {
      const double none = light(before.strips[block][f]);
      EXPECT_NEAR(light(after.strips[block][f]),
                  none * (1 + (there ? reflectance[blocks + block] : 0)), 0.02 * none)
          << f << " " << block;
    }
  }
}

TEST(CompareRandomEffects, WithoutItsEffectTextureIsScatterOfTheReflectance) {
  const Compared& compared = ComparedOnce(WithTexture()).compared;
  const double of_term = compared.Of("unknown.reflectance_scatter").log_evidence;
  EXPECT_NEAR(of_term, compared.Of(kAlbedoTexture).log_evidence, 4);
  for (const std::string_view other : {kPowerNoise, kExposureJitter, kVibration}) {
    EXPECT_GT(of_term, compared.Of(other).log_evidence + 3) << other;
  }
}

// Powers are independent if the correlation time is short, and have one common deviation if it is
// long.
TEST(RandomEffect, CorrelatedPowerIsIndependentOrCommon) {
  const RecordedSet set = MakeRecordedSet(Description(), {});
  const SetModel model(set, {});
  const auto law = MakeRandomEffect(RandomLaw::kCorrelatedPower, model);
  for (const bool common : {false, true}) {
    const Eigen::MatrixXd factor = law->CovarianceFactor({0.2, common ? 1e12 : 1e-3});
    const Eigen::MatrixXd covariance = factor * factor.transpose();
    for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
      EXPECT_NEAR(covariance(i, i), 0.04, 1e-9);
      const double expected = common || i == 0 ? 0.04 : 0;
      EXPECT_NEAR(covariance(i, 0), expected, 1e-6);
    }
  }
}

TEST(RandomEffect, IsChosenByTheLawOfTheDescription) {
  const RecordedSet set = MakeRecordedSet(Description(), {});
  const SetModel model(set, {});
  int with_law = 0;
  for (const Effect* effect : AllEffects()) {
    if (!HasRandomLaw(*effect)) continue;
    ++with_law;
    const RandomLaw law = effect->description().random_law;
    const auto random = MakeRandomEffect(law, model);
    ASSERT_NE(random, nullptr) << effect->description().id;
    EXPECT_EQ(random->amplitude() == Amplitude::kReflectance,
              effect->description().kind == EffectKind::kRandomPerPlace)
        << effect->description().id;
  }
  EXPECT_EQ(with_law, 4);
}

TEST(RandomEffect, CorrelatedMovementDisplacesRecordingsOrBlursThem) {
  const RecordedSet set = MakeRecordedSet(Description(), {});
  const SetModel model(set, {});
  const auto law = MakeRandomEffect(RandomLaw::kCorrelatedMovement, model);
  for (const double correlation_time_s : {1e-5, 1e-3, 1e-1}) {
    const std::vector<double> parameters = {1.5, correlation_time_s};
    const Eigen::MatrixXd factor = law->CovarianceFactor(parameters);
    const Eigen::VectorXd blur_px2 = law->VarianceWithin(parameters, {});
    ASSERT_EQ(blur_px2.size(), factor.rows());
    Eigen::Index at = 0;
    for (const RecordedFrame& frame : set.frames) {
      if (frame.plate_position_id < 0) continue;
      // Mean of the correlation over all pairs of moments of an exposure.
      constexpr int kMoments = 20000;
      double mean = 0;
      for (int k = 0; k < kMoments; ++k) {
        const double apart = (k + 0.5) / kMoments;
        mean += 2 * (1 - apart) / kMoments *
                std::exp(-apart * frame.nominal.exposure_time_s / correlation_time_s);
      }
      const double shift_px2 = factor.row(at).squaredNorm();
      EXPECT_NEAR(shift_px2, 2.25 * mean, 2e-3 * 2.25 * mean);
      EXPECT_NEAR(shift_px2 + blur_px2[at], 2.25, 1e-6);
      ++at;
    }
  }
}

TEST(CompareRandomEffects, WithoutItsEffectVibrationIsMovement) {
  const Compared& compared = ComparedOnce(WithVibration()).compared;
  const RandomEffectCandidate& movement = compared.Of("unknown.movement");
  for (const std::string_view other : std::initializer_list<std::string_view>{
           kPowerNoise, kExposureJitter, kAlbedoTexture, "unknown.power_scatter"}) {
    EXPECT_GT(movement.log_evidence, compared.Of(other).log_evidence + 10) << other;
  }
  // The root mean square of a sinusoid.
  const double root_mean_square = std::sqrt(0.5) * compared.Of(kVibration).parameters[0];
  EXPECT_NEAR(movement.parameters[0], root_mean_square, 0.2 * root_mean_square);
}

// Power that swings slowly, which no effect of the vocabulary does.
class SwingingPower final : public DescribedEffect {
 public:
  SwingingPower()
      : DescribedEffect({.id = "test.swinging_power",
                         .stage = Stage::kIllumination,
                         .summary = "power swings with the time",
                         .reference = "none",
                         .parameters = {{"relative", 0, 0, 1, 0.1}, {"period_s", 1, 1, 1e4, 1}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= 1 + p[0] * std::sin(2 * std::numbers::pi * frame.timestamp_s / p[1]);
  }
};

TEST(CompareRandomEffects, APowerThatSwingsIsNoNoiseOfAVocabularyButRemembers) {
  const SwingingPower swinging;
  const RecordedSet set = Render({{&swinging, {0.15, 300}}}, 26);
  const SetModel model(set, {});
  SetParameters start;
  start.line_shift_px = EstimateLineShifts(model, start);
  const FitResult null = FitSet(model, start, {}, {}, nullptr);
  const Effect* const term = FindFreeFormTerm("unknown.power_scatter");
  const std::vector<const Effect*> effects = {FindEffect(kPowerNoise), FindEffect(kExposureJitter),
                                              FindEffect(kAlbedoTexture), FindEffect(kVibration),
                                              term};
  const std::vector<RandomEffectCandidate> candidates = CompareRandomEffects(model, null, effects);
  ASSERT_EQ(candidates.size(), 5u);
  for (size_t i = 0; i + 1 < candidates.size(); ++i) {
    EXPECT_GT(candidates.back().log_evidence, candidates[i].log_evidence + 3)
        << effects[i]->description().id;
  }
  // The correlation time is about a quarter of a period.
  EXPECT_GT(candidates.back().parameters[1], 30);
  EXPECT_LT(candidates.back().parameters[1], 3000);
}

TEST(CompareRandomEffects, NoiseOfThePowerForgetsAtOnce) {
  const Compared& compared = ComparedOnce(WithPowerNoise()).compared;
  const RandomEffectCandidate& noise = compared.Of(kPowerNoise);
  const RandomEffectCandidate& term = compared.Of("unknown.power_scatter");
  // It contains the effect and pays for its further parameter.
  EXPECT_NEAR(term.largest_gain, noise.largest_gain, 1.5);
  EXPECT_LT(term.log_evidence, noise.log_evidence);
  EXPECT_GT(term.log_evidence, noise.log_evidence - 4);
}

TEST(CompareRandomEffects, JitterOfTheExposureScattersShortOnesMost) {
  const Compared& compared = ComparedOnce(WithExposureJitter()).compared;
  const RandomEffectCandidate& jitter = compared.Of(kExposureJitter);
  const RandomEffectCandidate& term = compared.Of("unknown.exposure_scatter");
  // It contains the effect and pays for its further parameter.
  EXPECT_NEAR(term.parameters[1], 1, 0.3);
  EXPECT_GT(term.log_evidence, jitter.log_evidence - 4);
  EXPECT_LT(term.log_evidence, jitter.log_evidence);
  // Without the effect itself, the discrepancy term of its stage leads.
  EXPECT_GT(term.log_evidence, compared.Of(kPowerNoise).log_evidence + 2);
  EXPECT_GT(term.log_evidence, compared.Of("unknown.power_scatter").log_evidence + 2);
}

Hypothesis BestOf(const RecordedSet& set, const std::vector<const Effect*>& effects) {
  const SetModel model(set, {});
  SetParameters start;
  start.line_shift_px = EstimateLineShifts(model, start);
  ComparisonSettings settings;
  settings.effects = effects;
  return CompareModels(model, FitSet(model, start, {}, {}, nullptr), settings,
                       [](double) { return true; })
      .ranked.front();
}

// Dark current and a random effect are both named, with their strengths.
void ExpectBoth(std::string_view scatter, const std::vector<double>& parameters, uint64_t seed) {
  const Effect* dark_current = FindEffect("sensor.dark_current");
  const RecordedSet set = Render({{dark_current, {25}}, {FindEffect(scatter), parameters}}, seed);
  const Hypothesis best =
      BestOf(set, {dark_current, FindEffect("illumination.ambient_light"), FindEffect(kPowerNoise),
                   FindEffect(kExposureJitter), FindEffect(kVibration)});
  ASSERT_EQ(best.effects.size(), 2u);
  EXPECT_EQ(best.effects[0].effect, dark_current);
  EXPECT_EQ(best.effects[1].effect->description().id, scatter);
  ASSERT_EQ(best.fit.effect_standard_errors.size(), 1 + parameters.size());
  EXPECT_NEAR(best.effects[0].parameters[0], 25, 4 * best.fit.effect_standard_errors[0]);
  EXPECT_NEAR(best.effects[1].parameters[0], parameters[0], 4 * best.fit.effect_standard_errors[1]);
}

TEST(CompareModels, NamesWhatScattersBesidesAnotherEffect) { ExpectBoth(kPowerNoise, {0.06}, 25); }

// Regression: the vibration was compared under a covariance of its own, the others under that of
// the null model, which expects no light where scattered light is.
TEST(CompareModels, CallsScatteredLightAndNoisyRowsNoVibration) {
  const Effect* scattering = FindEffect("surface.subsurface_scattering");
  const Effect* row_noise = FindEffect("sensor.row_noise");
  const RecordedSet set = Render({{scattering, {0.9, 7e-4}}, {row_noise, {20}}}, 34);
  const Hypothesis best = BestOf(set, {scattering, row_noise, FindEffect(kVibration)});
  ASSERT_EQ(best.effects.size(), 2u);
  EXPECT_TRUE(best.effects[0].effect == scattering || best.effects[1].effect == scattering);
  EXPECT_TRUE(best.effects[0].effect == row_noise || best.effects[1].effect == row_noise);
}

// The residual of the null model is uninformative about dark current until the vibration is fitted.
TEST(CompareModels, NamesAnotherEffectBesidesAStrongVibration) {
  ExpectBoth(kVibration, {3, 230}, 33);
}

}  // namespace
}  // namespace sightline
