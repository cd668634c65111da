// SPDX-License-Identifier: Apache-2.0
#include "core/block_adjustment/block_adjustment.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <utility>

namespace sightline {
namespace {

constexpr int kMostIterations = 60;

struct NormalEquations {
  Eigen::MatrixXd shared;                      // J_s' J_s
  std::vector<Eigen::MatrixXd> own, coupling;  // J_o' J_o, J_s' J_o
  Eigen::VectorXd shared_gradient;             // J_s' r
  std::vector<Eigen::VectorXd> own_gradient;   // J_o' r
  std::vector<Eigen::MatrixXd> block_shared;   // J_s' J_s of each block
  std::vector<Eigen::VectorXd> block_gradient;
};

double PriorSum(const BlockProblem& problem, const Eigen::VectorXd& shared) {
  double sum = 0;
  for (int i = 0; i < shared.size(); ++i) {
    const double sd = problem.prior_standard_deviation[i];
    if (sd > 0) sum += std::pow((shared[i] - problem.shared[i]) / sd, 2);
  }
  return sum;
}

double ResidualSum(const BlockProblem& problem, const Eigen::VectorXd& shared,
                   const std::vector<Eigen::VectorXd>& own) {
  double sum = 0;
  for (size_t k = 0; k < own.size(); ++k) {
    sum += problem.residuals(static_cast<int>(k), shared, own[k]).squaredNorm();
  }
  return sum;
}

NormalEquations MakeNormalEquations(const BlockProblem& problem, const Eigen::VectorXd& shared,
                                    const std::vector<Eigen::VectorXd>& own) {
  const auto count = shared.size();
  NormalEquations n;
  n.shared = Eigen::MatrixXd::Zero(count, count);
  n.shared_gradient = Eigen::VectorXd::Zero(count);
  for (size_t k = 0; k < own.size(); ++k) {
    const int block = static_cast<int>(k);
    const Eigen::VectorXd r = problem.residuals(block, shared, own[k]);
    Eigen::MatrixXd js = Eigen::MatrixXd::Zero(r.size(), count);
    Eigen::MatrixXd jo(r.size(), own[k].size());
    for (int i = 0; i < count; ++i) {
      if (problem.prior_standard_deviation[i] == 0) continue;
      Eigen::VectorXd plus = shared, minus = shared;
      const double step = problem.shared_step[i];
      plus[i] += step;
      minus[i] -= step;
      js.col(i) =
          (problem.residuals(block, plus, own[k]) - problem.residuals(block, minus, own[k])) /
          (2 * step);
    }
    for (int i = 0; i < own[k].size(); ++i) {
      Eigen::VectorXd plus = own[k], minus = own[k];
      plus[i] += problem.own_step;
      minus[i] -= problem.own_step;
      jo.col(i) =
          (problem.residuals(block, shared, plus) - problem.residuals(block, shared, minus)) /
          (2 * problem.own_step);
    }
    n.block_shared.push_back(js.transpose() * js);
    n.block_gradient.push_back(js.transpose() * r);
    n.shared += n.block_shared.back();
    n.shared_gradient += n.block_gradient.back();
    n.own.push_back(jo.transpose() * jo);
    n.coupling.push_back(js.transpose() * jo);
    n.own_gradient.push_back(jo.transpose() * r);
  }
  for (int i = 0; i < count; ++i) {
    const double sd = problem.prior_standard_deviation[i];
    if (sd > 0) {
      n.shared(i, i) += 1 / (sd * sd);
      n.shared_gradient[i] += (shared[i] - problem.shared[i]) / (sd * sd);
    }
  }
  return n;
}

// Schur complement of the own parameters. Held parameters get a diagonal of 1.
Eigen::MatrixXd Reduced(const BlockProblem& problem, const NormalEquations& n, double damping,
                        Eigen::VectorXd* gradient, std::vector<Eigen::MatrixXd>* own_inverse) {
  Eigen::MatrixXd reduced = n.shared;
  reduced.diagonal() *= 1 + damping;
  *gradient = n.shared_gradient;
  own_inverse->clear();
  for (size_t k = 0; k < n.own.size(); ++k) {
    Eigen::MatrixXd own = n.own[k];
    own.diagonal() *= 1 + damping;
    own_inverse->push_back(own.size() == 0 ? own : Eigen::MatrixXd(own.inverse()));
    if (own.size() == 0) continue;
    reduced -= n.coupling[k] * own_inverse->back() * n.coupling[k].transpose();
    *gradient -= n.coupling[k] * (own_inverse->back() * n.own_gradient[k]);
  }
  for (int i = 0; i < reduced.rows(); ++i) {
    if (problem.prior_standard_deviation[i] != 0) continue;
    reduced.row(i).setZero();
    reduced.col(i).setZero();
    reduced(i, i) = 1;
    (*gradient)[i] = 0;
  }
  return reduced;
}

}  // namespace

absl::StatusOr<BlockSolution> AdjustBlocks(const BlockProblem& problem) {
  Eigen::VectorXd shared = problem.shared;
  std::vector<Eigen::VectorXd> own = problem.own;
  double sum = ResidualSum(problem, shared, own) + PriorSum(problem, shared);
  const absl::Status undetermined =
      absl::InvalidArgumentError("the observations do not determine the parameters");
  if (!std::isfinite(sum)) return undetermined;
  double damping = 1e-4;
  Eigen::VectorXd gradient;
  std::vector<Eigen::MatrixXd> own_inverse;
  for (int iteration = 0; iteration < kMostIterations; ++iteration) {
    const NormalEquations n = MakeNormalEquations(problem, shared, own);
    bool better = false;
    double change = 0;
    for (; damping < 1e8 && !better; damping = better ? damping * 0.1 : damping * 10) {
      const Eigen::MatrixXd reduced = Reduced(problem, n, damping, &gradient, &own_inverse);
      const Eigen::VectorXd step = -reduced.ldlt().solve(gradient);
      const Eigen::VectorXd tried = shared + step;
      std::vector<Eigen::VectorXd> tried_own = own;
      for (size_t k = 0; k < own.size(); ++k) {
        if (own[k].size() == 0) continue;
        tried_own[k] -= own_inverse[k] * (n.own_gradient[k] + n.coupling[k].transpose() * step);
      }
      const double now = ResidualSum(problem, tried, tried_own) + PriorSum(problem, tried);
      better = std::isfinite(now) && now <= sum;
      if (!better) continue;
      change = (sum - now) / (1e-300 + sum);
      sum = now;
      shared = tried;
      own = std::move(tried_own);
    }
    if (!better || change < 1e-9) break;
  }
  const NormalEquations n = MakeNormalEquations(problem, shared, own);
  const Eigen::MatrixXd reduced = Reduced(problem, n, 0, &gradient, &own_inverse);
  const Eigen::LDLT<Eigen::MatrixXd> factor(reduced);
  BlockSolution solution;
  solution.shared_covariance =
      factor.solve(Eigen::MatrixXd::Identity(reduced.rows(), reduced.cols()));
  if (!factor.isPositive() || !solution.shared_covariance.allFinite()) return undetermined;
  for (int i = 0; i < shared.size(); ++i) {
    if (problem.prior_standard_deviation[i] == 0) {
      solution.shared_covariance(i, i) = 0;
    } else {
      ++solution.parameter_count;
    }
  }
  for (size_t k = 0; k < own.size(); ++k) {
    Eigen::MatrixXd information = n.block_shared[k];
    Eigen::VectorXd score = n.block_gradient[k];
    if (own[k].size() > 0) {
      information -= n.coupling[k] * own_inverse[k] * n.coupling[k].transpose();
      score -= n.coupling[k] * (own_inverse[k] * n.own_gradient[k]);
    }
    solution.block_information.push_back(std::move(information));
    solution.block_score.push_back(std::move(score));
    solution.residual_count +=
        static_cast<int>(problem.residuals(static_cast<int>(k), shared, own[k]).size());
    solution.parameter_count += static_cast<int>(own[k].size());
  }
  solution.sum_of_squares = ResidualSum(problem, shared, own);
  solution.shared = std::move(shared);
  solution.own = std::move(own);
  return solution;
}

}  // namespace sightline
