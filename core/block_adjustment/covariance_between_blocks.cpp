// SPDX-License-Identifier: Apache-2.0
#include "core/block_adjustment/covariance_between_blocks.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <vector>

namespace sightline {
namespace {

// Share of the target in a mean of outer products z z', from how much these scatter.
double ShrinkageTowards(const Eigen::MatrixXd& target, const Eigen::MatrixXd& mean,
                        const std::vector<Eigen::VectorXd>& z) {
  double scatter = 0;
  for (const Eigen::VectorXd& each : z) {
    scatter += (each * each.transpose() - mean).squaredNorm();
  }
  const auto count = static_cast<double>(z.size());
  scatter /= count * (count - 1);
  const double distance = (mean - target).squaredNorm();
  return distance > scatter ? scatter / distance : 1;
}

}  // namespace

Eigen::MatrixXd CovarianceBetweenBlocks(const BlockSolution& solution) {
  const Eigen::MatrixXd& independent = solution.shared_covariance;
  const size_t blocks = solution.block_score.size();
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < independent.rows(); ++i) {
    if (independent(i, i) > 0) free.push_back(i);
  }
  if (blocks < 3 || free.empty()) return independent;

  // Whitened parameters: L^-1 theta with L L' the covariance for independent residuals, so that
  // this covariance and the information of all data and priors together are the identity.
  const Eigen::MatrixXd covariance = independent(free, free);
  const Eigen::VectorXd size = covariance.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation =
      size.cwiseInverse().asDiagonal() * covariance * size.cwiseInverse().asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> factor(correlation);
  if (factor.info() != Eigen::Success) return independent;
  const Eigen::MatrixXd l = size.asDiagonal() * Eigen::MatrixXd(factor.matrixL());
  const auto count = static_cast<Eigen::Index>(free.size());
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(count, count);

  // Change of the parameters when a block is left out, in one Gauss-Newton step.
  Eigen::MatrixXd of_data = Eigen::MatrixXd::Zero(count, count);
  std::vector<Eigen::VectorXd> changes;
  for (size_t k = 0; k < blocks; ++k) {
    const Eigen::MatrixXd information =
        l.transpose() * solution.block_information[k](free, free) * l;
    const Eigen::VectorXd score = l.transpose() * solution.block_score[k](free);
    of_data += information;
    const Eigen::LDLT<Eigen::MatrixXd> others(identity - information);
    if (others.info() != Eigen::Success || !(others.vectorD().minCoeff() > 1e-6)) {
      return independent;  // the other blocks do not determine the parameters
    }
    changes.push_back(others.solve(score) * std::sqrt(static_cast<double>(blocks) - 1));
  }
  Eigen::MatrixXd jackknife = Eigen::MatrixXd::Zero(count, count);
  for (const Eigen::VectorXd& change : changes) {
    jackknife += change * change.transpose() / static_cast<double>(blocks);
  }
  const Eigen::MatrixXd target = of_data * (jackknife.trace() / of_data.trace());
  const double share = ShrinkageTowards(target, jackknife, changes);
  const Eigen::MatrixXd whitened =
      share * target + (1 - share) * jackknife + (identity - of_data);  // and what priors leave

  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(whitened);
  const Eigen::MatrixXd bounded = axes.eigenvectors() *
                                  axes.eigenvalues().cwiseMax(1).asDiagonal() *
                                  axes.eigenvectors().transpose();
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(independent.rows(), independent.cols());
  result(free, free) = l * bounded * l.transpose();
  return result;
}

}  // namespace sightline
