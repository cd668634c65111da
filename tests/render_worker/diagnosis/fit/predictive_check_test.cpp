// SPDX-License-Identifier: Apache-2.0
// Models that are true predict recordings that were not fitted, others do not.
#include "render_worker/diagnosis/fit/predictive_check.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

TEST(BayesFactorBound, TableOfSellkeBayarriAndBerger) {
  // Am. Stat. 55 (2001) 62, table 1: the odds -e p log p.
  EXPECT_NEAR(1 / BayesFactorBound(0.1), 0.625, 0.002);
  EXPECT_NEAR(1 / BayesFactorBound(0.05), 0.407, 0.001);
  EXPECT_NEAR(1 / BayesFactorBound(0.01), 0.125, 0.001);
  EXPECT_NEAR(1 / BayesFactorBound(0.001), 0.0188, 0.0001);
  EXPECT_EQ(BayesFactorBound(0.5), 1);
  EXPECT_TRUE(std::isfinite(BayesFactorBound(0)));
}

TEST(CheckPredictions, ATrueModelIsNotRejectedAndAnotherIs) {
  const RecordedSet right = RenderSmallSet({}, {}, 23);
  const SetModel model(right, {});
  const FitResult null = FitNull(model);
  const PredictiveCheck check = CheckPredictions(model, null, null, 1);
  EXPECT_GT(check.p_value, 0.05);
  EXPECT_GT(check.groups.size(), 5);

  RecordedSet wrong = right;
  FailInReciprocity(&wrong);
  const SetModel wrong_model(wrong, {});
  const FitResult wrong_null = FitNull(wrong_model);
  const PredictiveCheck rejected = CheckPredictions(wrong_model, wrong_null, wrong_null, 1);
  EXPECT_LT(rejected.p_value, 1e-6);
}

TEST(CheckPredictions, IsTheSameForTheSameSeedAndGroupsHoldAllNumbersOfTheirKind) {
  const RecordedSet set = RenderSmallSet({}, {}, 29);
  const SetModel model(set, {});
  const FitResult null = FitNull(model);
  const PredictiveCheck once = CheckPredictions(model, null, null, 7);
  const PredictiveCheck again = CheckPredictions(model, null, null, 7);
  EXPECT_EQ(once.log_score, again.log_score);
  int profile = 0, of_all_apertures = 0;
  for (const PredictedGroup& group : once.groups) {
    EXPECT_GT(group.degrees_of_freedom, 0) << group.name;
    if (group.name == "profile") profile = group.degrees_of_freedom;
    if (group.name.starts_with("f_number")) of_all_apertures += group.degrees_of_freedom;
  }
  EXPECT_GT(profile, 0);
  // Profiles are of one recording each, so they have one f-number.
  EXPECT_GE(of_all_apertures, profile);
}

}  // namespace
}  // namespace sightline
