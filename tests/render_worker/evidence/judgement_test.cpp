// SPDX-License-Identifier: Apache-2.0
#include "render_worker/evidence/judgement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace sightline {
namespace {

ComparedModel NoEffect(double excess) {
  return {.kind = ModelKind::kNoEffect, .log_prior = -1.2, .held_out_excess = excess};
}
ComparedModel Named(double log_evidence, double score, double excess) {
  return {.kind = ModelKind::kNamed,
          .log_evidence = log_evidence,
          .log_prior = -4.6,
          .held_out_score = score,
          .held_out_excess = excess};
}
ComparedModel WithTerm(double log_evidence, double score, double excess) {
  ComparedModel model = Named(log_evidence, score, excess);
  model.kind = ModelKind::kDiscrepancy;
  model.log_prior = -7;
  return model;
}

// Random comparisons, small and large differences alike.
std::vector<ComparedModel> RandomModels(std::mt19937& random) {
  std::uniform_int_distribution<int> count(1, 6), of_three(0, 2);
  std::uniform_real_distribution<double> decade(-1, 4), sign(-0.3, 1), excess(-0.5, 10);
  std::vector<ComparedModel> models = {NoEffect(excess(random))};
  for (int m = count(random); m > 0; --m) {
    const double evidence = sign(random) * std::pow(10, decade(random));
    const double score = sign(random) * std::pow(10, decade(random));
    ComparedModel model = of_three(random) == 0 ? WithTerm(evidence, score, excess(random))
                                                : Named(evidence, score, excess(random));
    if (models.size() > 1 && of_three(random) == 0) model.parts = {1};
    models.push_back(model);
  }
  return models;
}

std::vector<ComparedModel> ThoseThatPredict(const std::vector<ComparedModel>& models) {
  const std::vector<bool> predicting = Predicting(models);
  std::vector<ComparedModel> kept;
  for (size_t m = 0; m < models.size(); ++m) {
    if (predicting[m]) kept.push_back(models[m]);
  }
  return kept;
}

TEST(Judgement, RulesHoldForEveryAnswer) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> decades(-30, 0);
  int unknown = 0, remainders = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    const std::vector<ComparedModel> models = ThoseThatPredict(RandomModels(random));
    const double p_value = std::pow(10, decades(random));
    const double may_leave = trial % 2 == 0 ? kShareNamesMayLeave : kShareExactNamesMayLeave;
    const Judgement judgement = Judge(models, p_value, may_leave);
    EXPECT_NEAR(std::accumulate(judgement.probability.begin(), judgement.probability.end(), 0.0), 1,
                1e-9);
    const ComparedModel& answer = models[judgement.answer];
    const ComparedModel& named = models[judgement.best_named];
    EXPECT_NE(named.kind, ModelKind::kDiscrepancy);
    if (answer.kind == ModelKind::kDiscrepancy) {
      ++unknown;
      EXPECT_GT(answer.log_evidence, named.log_evidence);
      EXPECT_GT(answer.held_out_score, named.held_out_score + kClearGain_nats);
      EXPECT_GT(ShareLeft(named, models[0], &answer), may_leave);
      EXPECT_FALSE(judgement.remainder);
    }
    if (judgement.remainder) {
      ++remainders;
      EXPECT_EQ(judgement.answer, judgement.best_named);
      EXPECT_GE(judgement.remainder->share, 0);
      EXPECT_LE(judgement.remainder->share, 1);
      EXPECT_GE(judgement.remainder->probability, 0);
      EXPECT_LE(judgement.remainder->probability, 1);
      // If nothing may be left, the discrepancy leads and there is no remainder.
      EXPECT_EQ(judgement.remainder->small_share_decides,
                !Judge(models, p_value, 0).remainder.has_value());
    }
  }
  // The rules have been tried.
  EXPECT_GT(unknown, 500);
  EXPECT_GT(remainders, 500);
}

TEST(Judgement, NamesAndTermsMeetTheSameCondition) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<ComparedModel> models = RandomModels(random);
    const std::vector<bool> predicting = Predicting(models);
    for (size_t m = 1; m < models.size(); ++m) {
      models[m].kind =
          models[m].kind == ModelKind::kNamed ? ModelKind::kDiscrepancy : ModelKind::kNamed;
    }
    EXPECT_EQ(Predicting(models), predicting);
  }
}

TEST(Judgement, DoesNotDependOnTheOrder) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    const std::vector<ComparedModel> models = ThoseThatPredict(RandomModels(random));
    std::vector<size_t> order(models.size());
    std::iota(order.begin(), order.end(), size_t{0});
    std::shuffle(order.begin(), order.end(), random);
    std::vector<ComparedModel> shuffled;
    for (const size_t m : order) shuffled.push_back(models[m]);
    const Judgement a = Judge(models, 1e-4), b = Judge(shuffled, 1e-4);
    for (size_t m = 0; m < order.size(); ++m) {
      EXPECT_NEAR(b.probability[m], a.probability[order[m]], 1e-12);
    }
    EXPECT_EQ(a.remainder.has_value(), b.remainder.has_value());
  }
}

TEST(Judgement, AnAcceptedNullIsNotAccused) {
  // A term has gained evidence by chance but predicts nothing.
  const std::vector<ComparedModel> models = {NoEffect(-0.3), WithTerm(12, 2, -0.31)};
  const Judgement judgement = Judge(ThoseThatPredict(models), 0.9);
  EXPECT_EQ(judgement.answer, 0);
  EXPECT_FALSE(judgement.remainder);
}

// A bug found: chi squared per number of a complete model is below 1 where covariances are
// conservative, so that a null model without excess kept every name from being questioned.
TEST(Judgement, AWrongNameIsQuestionedAlsoIfTheNullModelHasNoExcess) {
  const std::vector<ComparedModel> models = {NoEffect(-0.16), Named(66, 60, -0.19),
                                             WithTerm(80, 75, -0.22)};
  const Judgement judgement = Judge(models, 0.9);
  EXPECT_EQ(judgement.answer, 2);
}

TEST(Judgement, ANameIsNotLostForWhatItLeaves) {
  // It is rejected beyond doubt, but leaves 1 % of the excess.
  const std::vector<ComparedModel> models = {NoEffect(100), Named(5000, 6000, 1),
                                             WithTerm(5100, 6100, 0.2)};
  const Judgement judgement = Judge(models, 1e-191);
  EXPECT_EQ(judgement.answer, 1);
  EXPECT_EQ(judgement.probability[1], 1);
  ASSERT_TRUE(judgement.remainder);
  EXPECT_EQ(judgement.remainder->discrepancy, 2);
  EXPECT_NEAR(judgement.remainder->share, 100.0 / 6100, 1e-12);
  EXPECT_GT(judgement.remainder->probability, 0.999);
}

TEST(Judgement, UnknownPhysicsThatPredictsLeads) {
  const std::vector<ComparedModel> models = {NoEffect(100), Named(5000, 6000, 40),
                                             WithTerm(9000, 9100, 0.2)};
  const Judgement judgement = Judge(models, 1e-50);
  EXPECT_EQ(judgement.answer, 2);
  EXPECT_GT(judgement.probability[2], 0.999);
}

TEST(Judgement, ARejectedNullWithoutBetterModelLeavesEverything) {
  const std::vector<ComparedModel> models = {NoEffect(3)};
  const Judgement judgement = Judge(models, 1e-12);
  EXPECT_EQ(judgement.answer, 0);
  ASSERT_TRUE(judgement.remainder);
  EXPECT_EQ(judgement.remainder->discrepancy, -1);
  EXPECT_EQ(judgement.remainder->share, 1);
}

}  // namespace
}  // namespace sightline
