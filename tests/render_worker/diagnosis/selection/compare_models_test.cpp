// SPDX-License-Identifier: Apache-2.0
// The model comparison on small rendered sets.
#include "render_worker/diagnosis/selection/compare_models.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/diagnose.h"
#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/diagnosis/fit/power.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

ModelComparison CompareOn(const RecordedSet& set, const std::vector<std::string>& ids) {
  const SetModel model(set, {});
  std::vector<const Effect*> effects;
  for (const std::string& id : ids) effects.push_back(FindEffect(id));
  ComparisonSettings settings;
  settings.effects = effects;
  return CompareModels(model, FitNull(model), settings, [](double) { return true; });
}

const std::vector<std::string> kSome = {"sensor.dark_current", "illumination.ambient_light",
                                        "optics.veiling_glare", "sensor.response_nonlinearity",
                                        "illumination.beam_quality"};

TEST(CompareModels, NamesDarkCurrentNotAmbientLight) {
  const RecordedSet set =
      RenderSmallSet(SomeDeviations(), {ActiveEffect{FindEffect("sensor.dark_current"), {25}}}, 11);
  const ModelComparison comparison = CompareOn(set, kSome);
  const Hypothesis& best = comparison.ranked.front();
  ASSERT_FALSE(best.effects.empty());
  EXPECT_EQ(best.effects.front().effect->description().id, "sensor.dark_current");
  EXPECT_GT(best.probability, 0.9);
  ASSERT_EQ(best.fit.effect_standard_errors.size(), 1);
  EXPECT_NEAR(best.effects.front().parameters[0], 25, 4 * best.fit.effect_standard_errors[0]);
}

TEST(CompareModels, FindsNothingWhereNothingIsMissing) {
  const ModelComparison comparison = CompareOn(RenderSmallSet(SomeDeviations(), {}, 17), kSome);
  EXPECT_TRUE(comparison.ranked.front().effects.empty());
}

// The names of the best explanation.
std::vector<std::string> Named(const ModelComparison& comparison) {
  std::vector<std::string> ids;
  for (const ActiveEffect& active : comparison.ranked.front().effects) {
    ids.emplace_back(active.effect->description().id);
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

// A bug found: a ghost line by itself was put where a copy of the image is, and tried there only
// besides the copy.
TEST(CompareModels, LooksForTheShapeOfASecondEffectBesidesTheFirst) {
  const ActiveEffect copy{FindEffect("optics.lens_reflection"), {5e-3, -1.7e-4, 0}};
  const ActiveEffect ghost{FindEffect("illumination.ghost_line"), {2.5e-3, 1.5e-3}};
  const ModelComparison comparison =
      CompareOn(RenderSmallSet(SomeDeviations(), {copy, ghost}, 41),
                {"optics.lens_reflection", "illumination.ghost_line", "optics.veiling_glare"});
  ASSERT_EQ(Named(comparison),
            (std::vector<std::string>{"illumination.ghost_line", "optics.lens_reflection"}));
  for (const ActiveEffect& active : comparison.ranked.front().effects) {
    if (active.effect != ghost.effect) continue;
    EXPECT_NEAR(active.parameters[1], ghost.parameters[1], 2e-4);
  }
}

// Deviations that make up for it are at their bounds, from where the power error takes them back.
TEST(CompareModels, NamesAPowerErrorBesidesAnotherEffect) {
  const ModelComparison comparison =
      CompareOn(RenderSmallSet(SomeDeviations(),
                               {{FindEffect("illumination.power_error"), {1.6}},
                                {FindEffect("illumination.ghost_line"), {0.02, 1.5e-3}}},
                               42),
                {"illumination.power_error", "illumination.ghost_line", "sensor.dark_current"});
  EXPECT_EQ(Named(comparison),
            (std::vector<std::string>{"illumination.ghost_line", "illumination.power_error"}));
}

// A bug found: the limit was a straight line's from half a prior scale on, wrong by a factor of ten
// and more for scatter (whose variance is what counts) and for what moves the line by pixels.
TEST(CompareModels, WhatIsSaidToBeDetectableHasAnExpectedGainOfFive) {
  const RecordedSet set = RenderSmallSet(SomeDeviations(), {}, 23);
  const std::vector<std::string> ids = {"sensor.row_noise",           "sensor.dark_current",
                                        "sensor.black_level_error",   "geometry.camera_roll",
                                        "sensor.dsnu_column_pattern", "surface.curved_plate"};
  const ModelComparison comparison = CompareOn(set, ids);
  const NullInformation information(set, {}, comparison.null.parameters);
  int checked = 0;
  for (const ScreenedEffect& screened : comparison.screened) {
    const EffectDescription& description = screened.strongest.effect->description();
    ASSERT_GT(screened.detectable, 0) << description.id;
    std::vector<double> values;
    for (const EffectParameter& p : description.parameters) values.push_back(p.null_value);
    values[screened.parameter] =
        ParameterFromStandardised(description.parameters[screened.parameter], screened.detectable);
    const double gain = information.ExpectedGain({{screened.strongest.effect, values}});
    // The screening's null model is not quite that of the end: to a factor of two.
    EXPECT_GT(gain, 2.5) << description.id;
    EXPECT_LT(gain, 10) << description.id;
    ++checked;
  }
  EXPECT_EQ(checked, static_cast<int>(ids.size()));
}

// In no vocabulary: a part of the light in a ring of 12 px.
class RingHalo final : public DescribedEffect {
 public:
  RingHalo()
      : DescribedEffect({.id = "test.ring_halo",
                         .stage = Stage::kOptics,
                         .summary = "",
                         .reference = "",
                         .parameters = {{"fraction", 0, 0, 1, 0.1}}}) {}
  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    optics.transfer.push_back([part = p[0]](double qx, double qy) {
      const double x = 2 * std::numbers::pi * 7e-5 * std::hypot(qx, qy);
      return std::complex<double>(1 - part + part * ::j0(x) * std::exp(-0.01 * x * x));
    });
  }
};

// A law of its own is not given the name of the nearest known one; that one keeps its name.
TEST(CompareModels, WhatIsNearAKnownLawButNotItIsUnknown) {
  const RingHalo ring;
  const Effect* glare = FindEffect("optics.veiling_glare");
  const std::vector<const Effect*> effects = {glare, FindEffect("sensor.dark_current"),
                                              FindEffect("illumination.beam_quality")};
  std::vector<const Effect*> terms;
  for (const Effect* term : FreeFormTerms()) {
    if (term->description().stage == Stage::kOptics) terms.push_back(term);
  }
  ComparisonSettings settings;
  settings.effects = effects;
  settings.free_forms = terms;
  const auto best = [&](const ActiveEffect& active) {
    const RecordedSet set = RenderSmallSet(SomeDeviations(), {active}, 19);
    const SetModel model(set, {});
    return CompareModels(model, FitNull(model), settings, [](double) { return true; })
        .ranked.front();
  };
  const Hypothesis near = best({&ring, {0.2}});
  ASSERT_FALSE(near.effects.empty());
  EXPECT_NE(FindFreeFormTerm(near.effects.back().effect->description().id), nullptr);
  EXPECT_GT(near.probability, 0.5);
  const Hypothesis known = best({glare, {0.2, 1e-4}});
  ASSERT_EQ(known.effects.size(), 1);
  EXPECT_EQ(known.effects[0].effect, glare);
}

// The best of an effect and two terms, all others left out.
Hypothesis BestAgainst(const RecordedSet& set, const char* effect, const char* term,
                       const char* other_term) {
  const std::vector<const Effect*> effects = {FindEffect(effect)};
  const std::vector<const Effect*> terms = {FindFreeFormTerm(other_term), FindFreeFormTerm(term)};
  ComparisonSettings settings;
  settings.effects = effects;
  settings.free_forms = terms;
  const SetModel model(set, {});
  return CompareModels(model, FitNull(model), settings, [](double) { return true; }).ranked.front();
}

// With all its coefficients the term for dark signals could as well bend and slope.
TEST(CompareModels, DarkSignalThatGrowsWithTimeTakesOneCoefficient) {
  const RecordedSet set =
      RenderSmallSet(SomeDeviations(), {{FindEffect("sensor.dark_current"), {25}}}, 29);
  const Hypothesis best =
      BestAgainst(set, "illumination.ambient_light", "unknown.dark_signal", "unknown.dark_course");
  ASSERT_EQ(best.effects.size(), 1);
  const EffectDescription& term = best.effects[0].effect->description();
  EXPECT_EQ(term.id, "unknown.dark_signal");
  ASSERT_EQ(best.free.size(), 1);
  const int fitted = best.free[0].parameter;
  EXPECT_EQ(term.parameters[fitted].name, "electrons_per_s");
  EXPECT_NEAR(best.effects[0].parameters[fitted], 25, 4 * best.fit.effect_standard_errors[0]);
}

// A bug found: its variance is a hundred times a weak pattern's, which the prior did not allow.
TEST(CompareModels, AStrongPixelPatternIsOneOfTheSensor) {
  const RecordedSet set =
      RenderSmallSet(SomeDeviations(), {{FindEffect("sensor.prnu"), {0.1}}}, 31);
  const Hypothesis best =
      BestAgainst(set, "optics.cover_glass_etalon", "unknown.noise", "unknown.field");
  ASSERT_EQ(best.effects.size(), 1);
  const EffectDescription& term = best.effects[0].effect->description();
  ASSERT_EQ(term.id, "unknown.noise");
  for (size_t k = 0; k < term.parameters.size(); ++k) {
    if (term.parameters[k].name != "gain_pattern_variance") continue;
    // In few recordings the prior draws it towards 0.
    EXPECT_GT(std::sqrt(best.effects[0].parameters[k]), 0.03);
    EXPECT_LT(std::sqrt(best.effects[0].parameters[k]), 0.11);
  }
}

// Bugs found: effects that begin beyond a threshold, or of which the first step tried moves the
// line by many pixels, were not even fitted.
TEST(CompareModels, FindsWhatBeginsFarFromItsNullValueAndWhatIsFarFromLinear) {
  const std::vector<std::pair<std::string, std::vector<double>>> cases = {
      {"sensor.lower_full_well", {2000}}, {"geometry.laser_roll", {0.05}}};
  for (const auto& [id, parameters] : cases) {
    const Effect* effect = FindEffect(id);
    const RecordedSet set = RenderSmallSet(SomeDeviations(), {{effect, parameters}}, 5);
    const ModelComparison comparison = CompareOn(set, {id});
    const Hypothesis& best = comparison.ranked.front();
    ASSERT_FALSE(best.effects.empty()) << id;
    const double error =
        std::hypot(best.fit.effect_standard_errors[0], kEffectError * parameters[0]);
    EXPECT_LT(error, 0.2 * parameters[0]) << id;
    EXPECT_NEAR(best.effects[0].parameters[0], parameters[0], 4 * error) << id;
  }
}

// Does next to nothing on one side of 0 and begins with a threshold on the other, as curvature of
// the field does where the recordings are a little out of focus.
class OneSided final : public DescribedEffect {
 public:
  OneSided()
      : DescribedEffect({.id = "test.one_sided",
                         .stage = Stage::kSensor,
                         .summary = "",
                         .reference = "",
                         .parameters = {{"strength", 0, -10, 10, 1}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_mean_electrons += 5 * std::max(0.0, -p[0] - 0.3) - 0.02 * p[0];
  }
};

// Stopped early it has what it has looked at, later what it has fitted; never a verdict.
TEST(CompareModels, StoppedKeepsWhatItHas) {
  const RecordedSet set =
      RenderSmallSet(SomeDeviations(), {{FindEffect("optics.f_number_error"), {1.3}}}, 5);
  const SetModel model(set, {});
  const FitResult null = FitNull(model);
  std::vector<const Effect*> effects;
  for (const char* id : {"sensor.dark_current", "optics.f_number_error", "geometry.camera_roll"}) {
    effects.push_back(FindEffect(id));
    ASSERT_NE(effects.back(), nullptr) << id;
  }
  ComparisonSettings settings;
  settings.effects = effects;
  const ModelComparison screening =
      CompareModels(model, null, settings, [](double fraction) { return fraction < 0.3; });
  EXPECT_FALSE(screening.finished);
  EXPECT_EQ(screening.screened.size(), 2u);
  ASSERT_EQ(screening.ranked.size(), 1u);
  EXPECT_TRUE(screening.ranked.front().effects.empty());
  int calls_after_stop = -1;
  const ModelComparison fitting =
      CompareModels(model, null, settings, [&calls_after_stop](double fraction) {
        if (fraction < 0.76 && calls_after_stop < 0) return true;
        ++calls_after_stop;
        return false;
      });
  EXPECT_FALSE(fitting.finished);
  EXPECT_EQ(calls_after_stop, 0);
  EXPECT_EQ(fitting.screened.size(), effects.size());
  ASSERT_FALSE(fitting.ranked.front().effects.empty());
  EXPECT_EQ(fitting.ranked.front().effects.front().effect, effects[1]);
  EXPECT_TRUE(CompareModels(model, null, settings, [](double) { return true; }).finished);
}

// A bug found: besides straight lines only three prior scales either way were looked at, which is
// too much of it.
TEST(CompareModels, FindsWhatNoStraightLineLeadsTo) {
  const OneSided effect;
  const std::vector<const Effect*> effects = {&effect};
  ComparisonSettings settings;
  settings.effects = effects;
  const RecordedSet set = RenderSmallSet(SomeDeviations(), {{&effect, {-1.2}}}, 37);
  const SetModel model(set, {});
  const ModelComparison comparison =
      CompareModels(model, FitNull(model), settings, [](double) { return true; });
  EXPECT_GT(comparison.screened[0].gain, 0.5 * comparison.ranked.front().log_evidence);
  ASSERT_FALSE(comparison.ranked.front().effects.empty());
  EXPECT_NEAR(comparison.ranked.front().effects[0].parameters[0], -1.2, 0.2);
}

// No number beyond a strength, as a rim that cuts all the light.
class Blackout final : public DescribedEffect {
 public:
  Blackout()
      : DescribedEffect({.id = "test.blackout",
                         .stage = Stage::kSensor,
                         .summary = "",
                         .reference = "",
                         .parameters = {{"strength", 0, -10, 10, 1}}}) {}
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_mean_electrons += p[0] > 1 ? std::nan("") : p[0];
  }
};

// A bug found: one fit that had started there made all probabilities no numbers.
TEST(CompareModels, AFitWithoutNumbersIsNoExplanation) {
  const Blackout blackout;
  const std::vector<const Effect*> effects = {&blackout, FindEffect("sensor.dark_current")};
  ComparisonSettings settings;
  settings.effects = effects;
  SetupDeviation deviation = SomeDeviations();
  deviation.dark_mean_electrons = 3;  // ten standard uncertainties
  const RecordedSet set = RenderSmallSet(deviation, {}, 41);
  const SetModel model(set, {});
  const ModelComparison comparison =
      CompareModels(model, FitNull(model), settings, [](double) { return true; });
  double sum = 0;
  for (const Hypothesis& hypothesis : comparison.ranked) sum += hypothesis.probability;
  EXPECT_NEAR(sum, 1, 1e-9);
}

// A rim that cuts only where it is shifted.
TEST(CompareModels, FindsWhatBeginsFartherOffWithAnotherParameter) {
  const Effect* effect = FindEffect("optics.mechanical_vignetting");
  const std::vector<double> parameters = {3.4e-3, 0.05};  // the pupil's radius is 2.9 mm at most
  const RecordedSet set = RenderSmallSet(SomeDeviations(), {{effect, parameters}}, 5);
  const ModelComparison comparison = CompareOn(set, {"optics.mechanical_vignetting"});
  const Hypothesis& best = comparison.ranked.front();
  ASSERT_FALSE(best.effects.empty());
  EXPECT_GT(best.log_evidence, 10);
  // Rim and shift follow each other: only their being there is certain.
  EXPECT_GT(best.effects[0].parameters[0], 2.857e-3);
}

TEST(CompareModels, PhysicsThatNoModuleHasIsNotGivenAName) {
  RecordedSet set = RenderSmallSet({}, {}, 31);
  FailInReciprocity(&set);
  const SetModel model(set, {});
  std::vector<const Effect*> effects;
  for (std::string_view id :
       {"sensor.dark_current", "illumination.ambient_light", "optics.veiling_glare",
        "sensor.response_nonlinearity", "sensor.smear", "sensor.dsnu_column_pattern",
        "surface.albedo_texture", "illumination.power_noise"}) {
    effects.push_back(FindEffect(id));
    ASSERT_NE(effects.back(), nullptr) << id;
  }
  ComparisonSettings settings;
  settings.effects = effects;
  settings.free_forms = FreeFormTerms();
  settings.max_effects = 1;
  const ModelComparison comparison =
      CompareModels(model, FitNull(model), settings, [](double) { return true; });
  double named = 0;
  for (const Hypothesis& hypothesis : comparison.ranked) {
    if (!hypothesis.effects.empty() && !IsFreeForm(hypothesis)) named += hypothesis.probability;
  }
  EXPECT_LT(named, 0.5);
  EXPECT_TRUE(IsFreeForm(comparison.ranked.front()));
}

}  // namespace
}  // namespace sightline
