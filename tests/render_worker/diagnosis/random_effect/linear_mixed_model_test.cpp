// SPDX-License-Identifier: Apache-2.0
// The marginal likelihood against that of the data's own multivariate normal distribution, whose
// n x n covariance is written out.
#include "render_worker/diagnosis/random_effect/linear_mixed_model.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "core/random/counter_random.h"

namespace sightline {
namespace {

struct Problem {
  LinearMixedModel model;
  Eigen::VectorXd offset;  // c
  Eigen::MatrixXd factor;  // L
};

Eigen::MatrixXd RandomMatrix(CounterRandom& random, Eigen::Index rows, Eigen::Index columns) {
  Eigen::MatrixXd matrix(rows, columns);
  for (Eigen::Index j = 0; j < columns; ++j) {
    for (Eigen::Index i = 0; i < rows; ++i) matrix(i, j) = random.Normal();
  }
  return matrix;
}

// Every third problem has no offset, every second a covariance of the amplitudes that is singular.
Problem RandomProblem(uint64_t seed) {
  CounterRandom random(seed, 0);
  const auto size = [&](int most) {
    return 1 + static_cast<Eigen::Index>(random.Uniform() * most);
  };
  const Eigen::Index n = 8 + size(8), k = size(4), m = size(5);
  Problem problem;
  problem.model.residual = 2 * RandomMatrix(random, n, 1);
  problem.model.nuisance = RandomMatrix(random, n, k);
  problem.model.nuisance_weight = RandomMatrix(random, k, 1).array().exp();
  problem.model.change = RandomMatrix(random, n, m);
  problem.model.log_determinant = random.Normal();
  if (seed % 3 != 0) {
    problem.model.offset_change = RandomMatrix(random, n, 2);
    problem.offset = RandomMatrix(random, 2, 1);
  }
  problem.factor = RandomMatrix(random, m, m).triangularView<Eigen::Lower>();
  if (seed % 2 == 0) problem.factor.col(0).setZero();
  return problem;
}

// Residual without its offset, and the covariance of that.
struct DenseNormal {
  Eigen::VectorXd residual;
  Eigen::MatrixXd covariance;  // I + J diag(w)^-1 J' + V K V'

  double LogDensity() const {
    return -0.5 *
           (residual.dot(covariance.inverse() * residual) + std::log(covariance.determinant()) +
            static_cast<double>(residual.size()) * std::log(2 * std::numbers::pi));
  }
};

DenseNormal Dense(const Problem& problem, const Eigen::MatrixXd& factor) {
  const LinearMixedModel& model = problem.model;
  DenseNormal dense;
  dense.residual = model.residual;
  if (problem.offset.size() > 0) dense.residual -= model.offset_change * problem.offset;
  const Eigen::MatrixXd prior = model.nuisance_weight.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd moved = model.change * factor;
  dense.covariance = Eigen::MatrixXd::Identity(dense.residual.size(), dense.residual.size()) +
                     model.nuisance * prior * model.nuisance.transpose() +
                     moved * moved.transpose();
  return dense;
}

constexpr uint64_t kProblems = 60;

TEST(LinearMixedModel, MarginalLikelihoodIsTheDenseNormalDensity) {
  for (uint64_t seed = 1; seed <= kProblems; ++seed) {
    SCOPED_TRACE(seed);
    const Problem problem = RandomProblem(seed);
    const double n = static_cast<double>(problem.model.residual.size());
    const double expected = Dense(problem, problem.factor).LogDensity() +
                            0.5 * n * std::log(2 * std::numbers::pi) -
                            0.5 * problem.model.nuisance_weight.array().log().sum() -
                            0.5 * problem.model.log_determinant;
    EXPECT_NEAR(
        LogMarginalLikelihood(ProjectOutNuisance(problem.model), problem.offset, problem.factor, 0),
        expected, 1e-8 * (1 + std::abs(expected)));
  }
}

TEST(LinearMixedModel, AmplitudesGainAsTheRatioOfDenseDensities) {
  for (uint64_t seed = 1; seed <= kProblems; ++seed) {
    SCOPED_TRACE(seed);
    const Problem problem = RandomProblem(seed);
    const ProjectedModel projected = ProjectOutNuisance(problem.model);
    const Eigen::MatrixXd none =
        Eigen::MatrixXd::Zero(problem.factor.rows(), problem.factor.cols());
    const double expected =
        Dense(problem, problem.factor).LogDensity() - Dense(problem, none).LogDensity();
    const auto at = [&](const Eigen::MatrixXd& factor) {
      return LogMarginalLikelihood(projected, problem.offset, factor, 7);
    };
    EXPECT_NEAR(at(problem.factor) - at(none), expected, 1e-8 * (1 + std::abs(expected)));
    // The formula of the header, where K is invertible.
    if (seed % 2 == 0) continue;
    const Eigen::MatrixXd covariance = problem.factor * problem.factor.transpose();
    const Eigen::VectorXd slope = DataAtOffset(projected, problem.offset).slope;
    const Eigen::MatrixXd information = covariance.inverse() + projected.inner;
    const double determinant = (Eigen::MatrixXd::Identity(covariance.rows(), covariance.rows()) +
                                covariance * projected.inner)
                                   .determinant();
    EXPECT_NEAR(0.5 * slope.dot(information.inverse() * slope) - 0.5 * std::log(determinant),
                expected, 1e-6 * (1 + std::abs(expected)));
  }
}

// Conditional normal distribution of amplitudes and nuisance parameters, given the data.
TEST(LinearMixedModel, PosteriorIsTheConditionalOfTheJointNormal) {
  for (uint64_t seed = 1; seed <= kProblems; ++seed) {
    SCOPED_TRACE(seed);
    const Problem problem = RandomProblem(seed);
    const LinearMixedModel& model = problem.model;
    const DenseNormal dense = Dense(problem, problem.factor);
    const Eigen::VectorXd explained = dense.covariance.inverse() * dense.residual;
    const Eigen::VectorXd standardised = (model.change * problem.factor).transpose() * explained;
    const Eigen::VectorXd nuisance = model.nuisance_weight.cwiseInverse().asDiagonal() *
                                     (model.nuisance.transpose() * explained);
    const MixedModelPosterior posterior =
        PosteriorOf(model, ProjectOutNuisance(model), problem.offset, problem.factor);
    EXPECT_LT((posterior.standardised_amplitudes - standardised).norm(), 1e-8);
    EXPECT_LT((posterior.amplitudes - problem.factor * standardised).norm(), 1e-8);
    EXPECT_LT((posterior.nuisance - nuisance).norm(), 1e-8);
    // |I + J W^-1 J' + V K V'| = |H| |I + K A| / |W|.
    EXPECT_NEAR(
        posterior.log_determinant,
        std::log(dense.covariance.determinant()) + model.nuisance_weight.array().log().sum(), 1e-8);
  }
}

}  // namespace
}  // namespace sightline
