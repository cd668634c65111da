// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/fit/score_test.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <vector>

#include "render_worker/diagnosis/fit/fit_quality.h"
#include "render_worker/diagnosis/fit/model_error.h"

namespace sightline {

ScoreTest TestDirections(const LinearFit& linear, const Eigen::MatrixXd& directions,
                         const Eigen::MatrixXd& model_error) {
  Eigen::MatrixXd projected(directions.rows(), directions.cols());
  for (Eigen::Index i = 0; i < directions.cols(); ++i) {
    projected.col(i) = linear.Project(directions.col(i));
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(directions.transpose() * projected);
  std::vector<Eigen::Index> tested;
  for (Eigen::Index i = 0; i < directions.cols(); ++i) {
    if (axes.eigenvalues()[i] > kTestedLength) tested.push_back(i);
  }
  ScoreTest test;
  test.degrees_of_freedom = static_cast<int>(tested.size());
  if (tested.empty()) return test;
  const Eigen::VectorXd scale = axes.eigenvalues()(tested).cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd turned = axes.eigenvectors()(Eigen::all, tested) * scale.asDiagonal();
  const Eigen::VectorXd score =
      turned.transpose() * (directions.transpose() * linear.ResidualAtBest());
  const Eigen::MatrixXd error = turned.transpose() * (projected.transpose() * model_error);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Identity(score.size(), score.size());
  covariance.noalias() += error * error.transpose();
  test.chi_squared = score.dot(Eigen::LLT<Eigen::MatrixXd>(covariance).solve(score));
  test.p_value = ChiSquaredPValue(kEvidenceWeight * test.chi_squared, test.degrees_of_freedom);
  return test;
}

}  // namespace sightline
