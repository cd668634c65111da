// SPDX-License-Identifier: Apache-2.0
// Scores of a true model follow their distribution; a departure along a tested direction is found.
#include "render_worker/diagnosis/fit/score_test.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

constexpr Eigen::Index kNumbers = 80, kParameters = 4, kDirections = 6;

Eigen::MatrixXd NormalMatrix(Eigen::Index rows, Eigen::Index columns, CounterRandom* random) {
  Eigen::MatrixXd matrix(rows, columns);
  for (double& x : matrix.reshaped()) x = random->Normal();
  return matrix;
}

// A linear model of whitened numbers, with a standard normal prior on every parameter.
struct LinearModel {
  Eigen::MatrixXd jacobian, directions;

  explicit LinearModel(CounterRandom* random)
      : jacobian(NormalMatrix(kNumbers, kParameters, random)),
        directions(NormalMatrix(kNumbers, kDirections, random)) {}

  // Fitted to numbers whose expectation departs from the prior mean's by `change`.
  FitResult FitTo(const Eigen::VectorXd& change, CounterRandom* random) const {
    const Eigen::VectorXd truth = NormalMatrix(kParameters, 1, random);
    const Eigen::VectorXd data =
        jacobian * truth + change + NormalMatrix(kNumbers, 1, random).col(0);
    FitResult fit;
    fit.prior_weight = Eigen::VectorXd::Ones(kParameters);
    const Eigen::MatrixXd information =
        Eigen::MatrixXd::Identity(kParameters, kParameters) + jacobian.transpose() * jacobian;
    fit.standardised = information.llt().solve(jacobian.transpose() * data);
    fit.residual = {data - jacobian * fit.standardised};
    fit.jacobian = {jacobian};
    fit.at_bound.assign(kParameters, false);
    return fit;
  }
};

TEST(TestDirections, ScoresOfATrueModelHaveTheirDegreesOfFreedom) {
  CounterRandom random(7, 0);
  const LinearModel model(&random);
  constexpr int kFits = 4000;
  double sum = 0, squares = 0;
  for (int k = 0; k < kFits; ++k) {
    const FitResult fit = model.FitTo(Eigen::VectorXd::Zero(kNumbers), &random);
    const ScoreTest test = TestDirections(LinearFit(fit), model.directions, {kNumbers, 0});
    ASSERT_EQ(test.degrees_of_freedom, kDirections);
    sum += test.chi_squared;
    squares += test.chi_squared * test.chi_squared;
  }
  const double mean = sum / kFits, variance = squares / kFits - mean * mean;
  // Standard errors: sqrt(2 n/N) of the mean, and about sqrt((8 n^2 + 48 n)/N) of the variance.
  EXPECT_NEAR(mean, kDirections, 4 * std::sqrt(2.0 * kDirections / kFits));
  EXPECT_NEAR(variance, 2 * kDirections,
              4 * std::sqrt((8.0 * kDirections * kDirections + 48 * kDirections) / kFits));
}

TEST(TestDirections, KnownErrorsOfTheModelAreNoDeparture) {
  CounterRandom random(11, 0);
  const LinearModel model(&random);
  const Eigen::MatrixXd error = 0.5 * NormalMatrix(kNumbers, 2, &random);
  constexpr int kFits = 4000;
  double with = 0, without = 0;
  for (int k = 0; k < kFits; ++k) {
    const FitResult fit = model.FitTo(error * NormalMatrix(2, 1, &random), &random);
    const LinearFit linear(fit);
    with += TestDirections(linear, model.directions, error).chi_squared / kFits;
    without += TestDirections(linear, model.directions, {kNumbers, 0}).chi_squared / kFits;
  }
  EXPECT_NEAR(with, kDirections, 4 * std::sqrt(2.0 * kDirections / kFits));
  EXPECT_GT(without, kDirections + 1);
}

TEST(TestDirections, FindsADepartureAlongADirectionAndNoneAlongAParameter) {
  CounterRandom random(13, 0);
  const LinearModel model(&random);
  const FitResult departed = model.FitTo(model.directions.col(2), &random);
  EXPECT_LT(TestDirections(LinearFit(departed), model.directions, {kNumbers, 0}).p_value, 1e-6);

  // Refitting absorbs what a parameter can do: there is nothing left to test.
  const FitResult fit = model.FitTo(Eigen::VectorXd::Zero(kNumbers), &random);
  const ScoreTest absorbed =
      TestDirections(LinearFit(fit), model.jacobian.leftCols(2), {kNumbers, 0});
  EXPECT_EQ(absorbed.degrees_of_freedom, 0);
  EXPECT_EQ(absorbed.p_value, 1);
}

TEST(TestDirections, DoesNotDependOnWhereTheFitHasStopped) {
  CounterRandom random(19, 0);
  const LinearModel model(&random);
  const FitResult fit = model.FitTo(Eigen::VectorXd::Zero(kNumbers), &random);
  FitResult stopped = fit;
  const Eigen::VectorXd short_of = 0.5 * NormalMatrix(kParameters, 1, &random);
  stopped.standardised -= short_of;
  stopped.residual[0] += model.jacobian * short_of;
  EXPECT_NEAR(TestDirections(LinearFit(stopped), model.directions, {kNumbers, 0}).chi_squared,
              TestDirections(LinearFit(fit), model.directions, {kNumbers, 0}).chi_squared, 1e-8);
}

TEST(TestDirections, DoesNotDependOnHowDirectionsAreCombined) {
  CounterRandom random(17, 0);
  const LinearModel model(&random);
  const FitResult fit = model.FitTo(Eigen::VectorXd::Zero(kNumbers), &random);
  const LinearFit linear(fit);
  const Eigen::MatrixXd mixing = NormalMatrix(kDirections, kDirections, &random);
  const Eigen::MatrixXd orthogonal = Eigen::MatrixXd(mixing.householderQr().householderQ());
  EXPECT_NEAR(TestDirections(linear, model.directions * orthogonal, {kNumbers, 0}).chi_squared,
              TestDirections(linear, model.directions, {kNumbers, 0}).chi_squared, 1e-8);
}

}  // namespace
}  // namespace sightline
