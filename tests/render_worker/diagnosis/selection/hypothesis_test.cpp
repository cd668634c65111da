// SPDX-License-Identifier: Apache-2.0
// Explanations are told apart by what their effects do.
#include "render_worker/diagnosis/selection/hypothesis.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "render_worker/diagnosis/selection/context.h"
#include "render_worker/diagnosis/selection/stages/stages.h"
#include "render_worker/effects/effect.h"

namespace sightline {
namespace {

const Effect* Named() { return FindEffect("illumination.power_error"); }

// Fit of 40 numbers: two known parameters, then those of effects.
FitResult SomeFit(const Eigen::MatrixXd& jacobian, int effects) {
  FitResult fit;
  fit.jacobian = {jacobian};
  fit.standardised = Eigen::VectorXd::Zero(jacobian.cols());
  fit.prior_weight = Eigen::VectorXd::Ones(jacobian.cols());
  fit.free.assign(effects, {0, 0});
  fit.chi_squared = 40;
  fit.data_count = 40;
  const Eigen::MatrixXd information =
      jacobian.transpose() * jacobian + Eigen::MatrixXd::Identity(jacobian.cols(), jacobian.cols());
  fit.log_determinant = std::log(information.determinant());
  return fit;
}

Hypothesis SomeHypothesis(const Eigen::MatrixXd& jacobian) {
  Hypothesis hypothesis = MakeHypothesis({{Named(), {1}}});
  hypothesis.fit = SomeFit(jacobian, 1);
  hypothesis.fit.effect_standard_errors = {0.1};
  return hypothesis;
}

// A bug found: the known parameters' derivatives, found by steps of other lengths at places a
// little apart, told explanations apart by up to four nats.
TEST(LogEvidence, IsNotToldByDerivativesOfKnownParameters) {
  srand(5);
  const Eigen::MatrixXd known = Eigen::MatrixXd::Random(40, 2);
  const Eigen::MatrixXd effect = Eigen::MatrixXd::Random(40, 1);
  const FitResult null = SomeFit(known, 0);
  Eigen::MatrixXd jacobian(40, 3);
  jacobian << known, effect;
  const double evidence = EvidenceOver(SomeHypothesis(jacobian), null).LogMarginalLikelihood();
  EXPECT_NEAR(EvidenceOver(SomeHypothesis(jacobian), null, null).LogMarginalLikelihood(), evidence,
              1e-12);
  jacobian.leftCols(2) *= 1.3;
  EXPECT_LT(EvidenceOver(SomeHypothesis(jacobian), null).LogMarginalLikelihood(), evidence - 0.3);
  EXPECT_NEAR(EvidenceOver(SomeHypothesis(jacobian), null, null).LogMarginalLikelihood(), evidence,
              1e-12);
}

// y = J x + noise of covariance C, x normal of variance 1: the fit that maximises the posterior.
FitResult FitOfLinearModel(const Eigen::VectorXd& y, const Eigen::MatrixXd& derivatives,
                           const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> factor(covariance);
  const Eigen::VectorXd white = factor.matrixL().solve(y);
  const Eigen::MatrixXd jacobian = factor.matrixL().solve(derivatives);
  const Eigen::MatrixXd information =
      jacobian.transpose() * jacobian +
      Eigen::MatrixXd::Identity(derivatives.cols(), derivatives.cols());
  FitResult fit;
  fit.jacobian = {jacobian};
  fit.standardised = information.ldlt().solve(jacobian.transpose() * white);
  fit.prior_weight = Eigen::VectorXd::Ones(derivatives.cols());
  fit.chi_squared = (white - jacobian * fit.standardised).squaredNorm();
  fit.prior = fit.standardised.squaredNorm();
  fit.data_count = static_cast<int>(y.size());
  fit.data_log_determinant = 2 * factor.matrixLLT().diagonal().array().log().sum();
  fit.log_determinant = std::log(information.determinant());
  return fit;
}

double MarginalLogLikelihood(const Eigen::VectorXd& y, const Eigen::MatrixXd& derivatives,
                             const Eigen::MatrixXd& covariance) {
  const Eigen::MatrixXd marginal = covariance + derivatives * derivatives.transpose();
  return -0.5 * (y.dot(marginal.ldlt().solve(y)) + std::log(marginal.determinant()));
}

// A bug found: candidates that were fitted under a covariance of their own lacked its determinant.
TEST(LogEvidence, IsTheMarginalLikelihoodWhereTheModelIsLinear) {
  srand(6);
  const Eigen::VectorXd y = Eigen::VectorXd::Random(12);
  const Eigen::MatrixXd few = Eigen::MatrixXd::Random(12, 2);
  Eigen::MatrixXd more(12, 3);
  more << few, Eigen::MatrixXd::Random(12, 1);
  const Eigen::MatrixXd covariance =
      0.3 * Eigen::MatrixXd::Identity(12, 12) + Eigen::MatrixXd::Constant(12, 12, 0.05);
  Eigen::MatrixXd wider = 2 * covariance;
  wider.diagonal().head(4) *= 3;
  const FitResult null = FitOfLinearModel(y, few, covariance);
  Hypothesis hypothesis = MakeHypothesis({});
  for (const Eigen::MatrixXd& own : {covariance, wider}) {
    hypothesis.fit = FitOfLinearModel(y, more, own);
    EXPECT_NEAR(EvidenceOver(hypothesis, null).LogMarginalLikelihood(),
                MarginalLogLikelihood(y, more, own) - MarginalLogLikelihood(y, few, covariance),
                1e-9);
  }
}

// Numbers in other units, or put together otherwise, tell the same.
TEST(LogEvidence, DoesNotDependOnUnitsAndOrderOfTheData) {
  srand(7);
  const Eigen::VectorXd y = Eigen::VectorXd::Random(10);
  const Eigen::MatrixXd few = Eigen::MatrixXd::Random(10, 1);
  Eigen::MatrixXd more(10, 2);
  more << few, Eigen::MatrixXd::Random(10, 1);
  const Eigen::MatrixXd covariance = 0.2 * Eigen::MatrixXd::Identity(10, 10);
  const Eigen::MatrixXd mix = Eigen::MatrixXd::Random(10, 10);
  Hypothesis hypothesis = MakeHypothesis({});
  hypothesis.fit = FitOfLinearModel(y, more, covariance);
  const double evidence =
      EvidenceOver(hypothesis, FitOfLinearModel(y, few, covariance)).LogMarginalLikelihood();
  const Eigen::MatrixXd mixed = mix * covariance * mix.transpose();
  hypothesis.fit = FitOfLinearModel(mix * y, mix * more, mixed);
  EXPECT_NEAR(
      EvidenceOver(hypothesis, FitOfLinearModel(mix * y, mix * few, mixed)).LogMarginalLikelihood(),
      evidence, 1e-6);
}

// A bug found: a strong vibration was named with an astigmatism of 2.9 +- 2.9 waves.
TEST(EffectsAreDetected, AsksForStrengthsThatAreKnown) {
  Hypothesis pair =
      MakeHypothesis({{FindEffect("optics.veiling_glare"), {0.1, 0.01}}, {Named(), {1.1}}});
  const auto with_errors = [&](double power_error) {
    pair.fit.effect_standard_errors.clear();
    for (const auto& free : pair.free) {
      const bool power = pair.effects[free.effect].effect == Named();
      pair.fit.effect_standard_errors.push_back(power ? power_error : 0.001);
    }
    return EffectsAreDetected(pair);
  };
  EXPECT_TRUE(with_errors(0.02));
  EXPECT_FALSE(with_errors(0.2));
}

TEST(MakeHypothesis, OrdersEffectsAsTheyActAndFreesAllThatIsFitted) {
  const ActiveEffect glare{FindEffect("optics.veiling_glare"), {0.1, 0.01}};
  const ActiveEffect power{Named(), {1.1}};
  const Hypothesis one = MakeHypothesis({glare, power}), other = MakeHypothesis({power, glare});
  ASSERT_EQ(one.effects.size(), 2);
  EXPECT_EQ(one.free.size(), 3);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(one.effects[i].effect, other.effects[i].effect);
  EXPECT_EQ(one.effects[0].effect, Named());  // light comes before the lens
  EXPECT_TRUE(Has(one, glare.effect));
  EXPECT_FALSE(Has(MakeHypothesis({power}), glare.effect));
}

TEST(SortedByEvidence, LeavesOutWhatIsNoNumberAndKeepsTheOrderOfEquals) {
  std::vector<Hypothesis> hypotheses(4);
  hypotheses[0].log_evidence = 1;
  hypotheses[1].log_evidence = std::nan("");
  hypotheses[2].log_evidence = 3;
  hypotheses[3].log_evidence = 1;
  hypotheses[3].log_prior = -1;  // tells the equal ones apart
  const std::vector<Hypothesis> sorted = SortedByEvidence(hypotheses);
  ASSERT_EQ(sorted.size(), 3);
  EXPECT_EQ(sorted[0].log_evidence, 3);
  EXPECT_EQ(sorted[1].log_prior, 0);
  EXPECT_EQ(sorted[2].log_prior, -1);
}

TEST(RankHypotheses, ProbabilitiesSumToOneAndFollowEvidenceAndPriors) {
  std::vector<Hypothesis> hypotheses(3);
  for (int i = 0; i < 2; ++i) {
    hypotheses[i] = SomeHypothesis(Eigen::MatrixXd::Identity(40, 3));
    hypotheses[i].log_evidence = 8.0 + i;
  }
  hypotheses[2].fit = hypotheses[0].fit;  // the null model
  const std::vector<Hypothesis> ranked =
      RankHypotheses({.effects = 60, .free_forms = 30}, hypotheses);
  double sum = 0;
  for (const Hypothesis& hypothesis : ranked) sum += hypothesis.probability;
  EXPECT_NEAR(sum, 1, 1e-12);
  EXPECT_EQ(ranked[0].log_evidence, 9);
  EXPECT_GT(ranked[0].probability, ranked[1].probability);
  // One effect of sixty starts with less than that nothing is missing.
  EXPECT_LT(ranked[0].log_prior, std::log(1.0 / 60));
  EXPECT_TRUE(ranked[2].effects.empty());
}

}  // namespace
}  // namespace sightline
