// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/fit/judge_paths.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {
namespace {

// A hypothesis with this score, of which `held_out` is that of 100 held-out tiles.
PathHypothesis Scored(std::vector<std::string> effects, double score, double held_out,
                      double chi_squared_per_tile) {
  PathHypothesis hypothesis;
  hypothesis.effects = std::move(effects);
  hypothesis.log_prior = -1 - static_cast<double>(hypothesis.effects.size());
  hypothesis.log_predictive = score;
  hypothesis.best.held_out.fit = held_out;
  hypothesis.best.held_out_count = 100;
  hypothesis.best.held_out_chi_squared = 100 * chi_squared_per_tile;
  return hypothesis;
}

const std::string kMap(kUnknownLight);

TEST(JudgePaths, RulesHoldForEveryAnswer) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> decade(-1, 4), sign(-0.3, 1), chi(0.8, 20);
  const auto number = [&] { return sign(random) * std::pow(10, decade(random)); };
  int unknown = 0, remainders = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const std::vector<PathHypothesis> hypotheses = {
        Scored({}, 0, 0, chi(random)), Scored({"a"}, number(), number(), chi(random)),
        Scored({"b"}, number(), number(), chi(random)),
        Scored({"a", "b"}, number(), number(), chi(random)),
        Scored({kMap}, number(), number(), chi(random))};
    const JudgedPaths judged = JudgePaths(hypotheses);
    EXPECT_NEAR(std::accumulate(judged.probability.begin(), judged.probability.end(), 0.0), 1,
                1e-9);
    EXPECT_TRUE(judged.predicts[0]);
    for (size_t h = 1; h < hypotheses.size(); ++h) {
      const double gain = hypotheses[h].best.HeldOutLogDensity();
      EXPECT_TRUE(!judged.predicts[h] || gain > kClearGain_nats);
      EXPECT_TRUE(judged.predicts[h] || judged.probability[h] == 0);
    }
    if (judged.predicts[3]) {
      for (const size_t part : {1, 2}) {
        EXPECT_GT(hypotheses[3].best.HeldOutLogDensity(),
                  hypotheses[part].best.HeldOutLogDensity() + kClearGain_nats);
      }
    }
    if (judged.probability[4] > 0.5) ++unknown;
    if (judged.probability[4] > 0) {
      EXPECT_FALSE(judged.remainder);
    }
    if (!judged.remainder) continue;
    ++remainders;
    EXPECT_EQ(judged.remainder->discrepancy, 4);
    EXPECT_EQ(judged.probability[4], 0);
  }
  EXPECT_GT(unknown, 100);
  EXPECT_GT(remainders, 100);
}

// The map has more evidence and predicts better, but the name leaves 1 % of the excess and
// 2.4 % of the score.
TEST(JudgePaths, ANameIsNotLostForWhatItLeaves) {
  const JudgedPaths judged = JudgePaths(
      {Scored({}, 0, 0, 18), Scored({"a"}, 9000, 4000, 1.17), Scored({kMap}, 9100, 4100, 1)});
  EXPECT_NEAR(judged.probability[1], 1, 1e-12);
  ASSERT_TRUE(judged.remainder);
  EXPECT_NEAR(judged.remainder->share, 100.0 / 4100, 1e-12);
}

TEST(JudgePaths, TheMapLeadsWhereNoNameIsNear) {
  const JudgedPaths judged = JudgePaths(
      {Scored({}, 0, 0, 18), Scored({"a"}, 3000, 1000, 9), Scored({kMap}, 9100, 4100, 1)});
  EXPECT_GT(judged.probability[2], 0.999);
  EXPECT_FALSE(judged.remainder);
}

// A second effect of no strength changes nothing that was held out.
TEST(JudgePaths, APairMustPredictBetterThanItsParts) {
  const JudgedPaths judged =
      JudgePaths({Scored({}, 0, 0, 18), Scored({"a"}, 3000, 1000, 1), Scored({"b"}, 10, 5, 17),
                  Scored({"a", "b"}, 3004, 1001, 1)});
  EXPECT_FALSE(judged.predicts[3]);
  EXPECT_NEAR(judged.probability[1], 1, 1e-12);
}

TEST(PathHypothesis, TermsMakeUpTheScore) {
  PathHypothesis hypothesis;
  hypothesis.best.evidence = {
      .fit = -100, .covariance = 30, .curvature = -8, .parameter_prior = -3};
  hypothesis.best.held_out = {.fit = -90, .covariance = 28};
  // The mean over two shapes, of which the other contributes nothing.
  hypothesis.log_predictive = hypothesis.best.LogPredictive() - std::log(2);
  hypothesis.log_prior = -4;
  const Evidence terms = hypothesis.Terms();
  EXPECT_NEAR(terms.LogMarginalLikelihood(), hypothesis.log_predictive, 1e-12);
  EXPECT_EQ(terms.model_prior, -4);
  EXPECT_EQ(terms.fit, -190);
}

}  // namespace
}  // namespace sightline
