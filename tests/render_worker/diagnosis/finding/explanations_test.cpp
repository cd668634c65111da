// SPDX-License-Identifier: Apache-2.0
// The answer in words: reasons, remainder, and the finding.
#include "render_worker/diagnosis/finding/explanations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/finding/appearance.h"
#include "render_worker/diagnosis/finding/finding_text.h"
#include "render_worker/effects/discrepancy/free_form.h"
#include "render_worker/effects/stage_name.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

Hypothesis Fitted(const FitResult& fit, std::vector<ActiveEffect> effects, double log_evidence,
                  double probability) {
  Hypothesis hypothesis;
  hypothesis.effects = std::move(effects);
  hypothesis.fit = fit;
  hypothesis.log_evidence = log_evidence;
  hypothesis.evidence.fit = log_evidence;
  hypothesis.probability = probability;
  return hypothesis;
}

PredictedGroup Group(const char* name, double chi_squared, double p_value) {
  PredictedGroup group;
  group.name = name;
  group.chi_squared = chi_squared;
  group.degrees_of_freedom = 100;
  group.p_value = p_value;
  return group;
}

// A name that leads although a discrepancy term has 100 nats more.
class Explanations : public ::testing::Test {
 protected:
  Explanations() : set_(RenderSmallSet({}, {}, 4)), model_(set_, {}) {
    comparison_.null = FitNull(model_);
    const Effect* term = FreeFormTerms().front();
    const Hypothesis named =
        Fitted(comparison_.null, {{FindEffect("sensor.row_noise"), {2}}}, 5000, 1);
    comparison_.ranked = {named, Fitted(comparison_.null, {AtNullValues(*term)}, 5100, 0),
                          Fitted(comparison_.null, {}, 0, 0)};
    comparison_.named = named;
    // Both p-values are too small for a number: chi squared decides which is worst.
    comparison_.named_check.groups = {Group("profile", 900, 0), Group("texture", 4000, 0),
                                      Group("burst", 9000, 0.5)};
    comparison_.named_check.p_value = 0;
    comparison_.remainder = RemainderOfAnswer{.term = term, .share = 0.02, .probability = 0.999};
  }

  v1::Diagnosis Described() {
    v1::Diagnosis diagnosis;
    AddExplanations(model_, comparison_, 1, &diagnosis);
    diagnosis.mutable_named_check()->set_p_value(comparison_.named_check.p_value);
    return diagnosis;
  }

  RecordedSet set_;
  SetModel model_;
  ModelComparison comparison_;
};

TEST_F(Explanations, UnknownPhysicsIsSaidToLookLikeItsTerms) {
  v1::Diagnosis diagnosis = Described();
  EXPECT_EQ(AppearanceText(comparison_, diagnosis), "");  // a name leads
  std::swap(comparison_.ranked[0], comparison_.ranked[1]);
  Hypothesis& best = comparison_.ranked[0];
  const EffectDescription& description = best.effects[0].effect->description();
  // One coefficient of five standard errors, and no others that are known to differ from 0.
  best.free = {{0, 1}};
  best.fit.covariance = Eigen::MatrixXd::Identity(1, 1);
  best.effects[0].parameters[1] = 5 * description.parameters[1].prior_scale;
  diagnosis.add_laws()->set_law("proportional to exposure_time_s^1");
  const std::string text = AppearanceText(comparison_, diagnosis);
  EXPECT_THAT(text, AllOf(HasSubstr(std::string(description.summary)),
                          HasSubstr(std::string(description.parameters[1].name)),
                          HasSubstr("proportional to exposure_time_s^1"),
                          HasSubstr("sensor.row_noise, has 100 nats less evidence")));
  EXPECT_THAT(text, Not(HasSubstr(std::string(description.parameters[0].name) + " =")));
}

TEST_F(Explanations, ReasonsAreTrueOfANameThatLeads) {
  const v1::Diagnosis diagnosis = Described();
  ASSERT_EQ(diagnosis.ranked_size(), 3);
  EXPECT_EQ(diagnosis.ranked(0).effect(), "sensor.row_noise");
  EXPECT_THAT(diagnosis.ranked(0).reason(), Not(HasSubstr("best")));
  EXPECT_THAT(diagnosis.ranked(1).reason(),
              AllOf(HasSubstr("100 nats more evidence"), HasSubstr("leaves only 2 %")));
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    EXPECT_THAT(explanation.reason(), Not(HasSubstr("-")));
    EXPECT_EQ(explanation.evidence().fit_nats(), explanation.log_evidence_gain());
  }
  // The term's fit is that of the null model: it predicts no better.
  comparison_.remainder->share = 0.5;
  comparison_.named_check.log_score = 1e9;
  EXPECT_THAT(Described().ranked(1).reason(), HasSubstr("in the prediction"));
  comparison_.ranked[1].log_evidence = 4980;
  EXPECT_THAT(Described().ranked(1).reason(), HasSubstr("20 nats less evidence"));
}

TEST_F(Explanations, RemainderHasStageShareProbabilityAndWorstGroup) {
  const v1::Diagnosis diagnosis = Described();
  const Effect* term = comparison_.remainder->term;
  EXPECT_EQ(diagnosis.remainder().stage(), StageName(term->description().stage));
  EXPECT_EQ(diagnosis.remainder().share(), 0.02);
  EXPECT_EQ(diagnosis.remainder().probability(), 0.999);
  EXPECT_EQ(diagnosis.remainder().group(), "texture");
  const std::string finding = FindingText(comparison_.ranked[0], diagnosis);
  EXPECT_THAT(finding, AllOf(HasSubstr("sensor.row_noise"),
                             HasSubstr(".\n2 % of the difference is left, mostly in texture; no "
                                       "known effect describes it (probability 0.99)."),
                             HasSubstr("A model-discrepancy term at the stage")));
  comparison_.remainder->term = nullptr;
  EXPECT_EQ(Described().remainder().stage(), "");
  comparison_.remainder.reset();
  const v1::Diagnosis without = Described();
  EXPECT_FALSE(without.has_remainder());
  EXPECT_THAT(FindingText(comparison_.ranked[0], without), Not(HasSubstr("\n")));
}

TEST_F(Explanations, ARejectedNullModelIsNotCalledComplete) {
  comparison_.ranked = {Fitted(comparison_.null, {}, 0, 1)};
  comparison_.remainder = RemainderOfAnswer{.share = 1, .probability = 0.999};
  const std::string rejected = FindingText(comparison_.ranked[0], Described());
  EXPECT_THAT(rejected,
              AllOf(Not(HasSubstr("Nothing is missing")),
                    HasSubstr("\nNo effect that is known predicts these recordings better"),
                    HasSubstr("in texture")));
  comparison_.named_check.p_value = 0.4;
  comparison_.remainder.reset();
  EXPECT_THAT(FindingText(comparison_.ranked[0], Described()),
              AllOf(HasSubstr("Nothing is missing"), Not(HasSubstr("\n"))));
}

}  // namespace
}  // namespace sightline
