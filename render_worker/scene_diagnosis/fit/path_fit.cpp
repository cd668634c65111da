// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/fit/path_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "core/statistics/normal_distribution.h"
#include "render_worker/scene_diagnosis/fit/student_t.h"

namespace sightline {
namespace {

constexpr int kMaxIterations = 25;
// The speckle factor is estimated along with the first iterations, then fixed so that they
// converge.
constexpr int kSpeckleRounds = 6;
// Convergence: squared step over its posterior covariance, per parameter. 1e-6 is a thousandth of a
// standard deviation.
constexpr double kConvergedStep = 1e-6;
// The speckle factor has a log-normal prior of this width and is searched for on a logarithmic
// grid from exp(-2.5) to exp(2.5). The width is an assumption: a factor of two either way.
constexpr double kSpecklePrior = 0.7, kSpeckleStep = 0.1;
constexpr int kSpeckleSteps = 25;

double LogSpecklePrior(double factor) {
  const double z = std::log(factor) / kSpecklePrior;
  return -0.5 * z * z;
}

// Posterior mode of the speckle factor on its grid, given the expected means.
double SpeckleFactor(const BlockMeans& blocks, const ExpectedBlocks& expected) {
  const BlockGrid& grid = blocks.grid();
  double best = 1, best_density = -std::numeric_limits<double>::infinity();
  for (int step = -kSpeckleSteps; step <= kSpeckleSteps; ++step) {
    const double factor = std::exp(kSpeckleStep * step);
    double density = LogSpecklePrior(factor);
    for (int b = 0; b < grid.count(); ++b) {
      if (grid.HeldOut(b)) continue;
      const double variance =
          factor * expected.speckle_variance_dn2[b] + expected.other_variance_dn2[b];
      density +=
          LogStudentDensity((blocks.observed_dn()[b] - expected.mean_dn[b]) / std::sqrt(variance)) -
          0.5 * std::log(variance);
    }
    if (density <= best_density) continue;
    best_density = density;
    best = factor;
  }
  return best;
}

// Independent normal priors of the factors.
struct FactorPrior {
  Eigen::VectorXd mean, precision;
};

FactorPrior PriorOf(const PathChoice& paths) {
  const auto count = static_cast<Eigen::Index>(paths.size());
  FactorPrior prior{Eigen::VectorXd(count), Eigen::VectorXd(count)};
  for (Eigen::Index k = 0; k < count; ++k) {
    const LightPath& path = *paths[static_cast<size_t>(k)];
    prior.mean[k] = path.prior_mean;
    prior.precision[k] = 1 / std::pow(path.prior_standard_deviation, 2);
  }
  return prior;
}

// Newton's equations with the weights of Student's t: hessian * step = gradient.
struct NormalEquations {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
};

NormalEquations Weighted(const BlockMeans& blocks, const ExpectedBlocks& expected,
                         const Eigen::VectorXd& variance_dn2, const FactorPrior& prior,
                         const Eigen::VectorXd& factors) {
  Eigen::MatrixXd hessian = prior.precision.asDiagonal();
  Eigen::VectorXd gradient = -prior.precision.cwiseProduct(factors - prior.mean);
  for (int b = 0; b < blocks.grid().count(); ++b) {
    if (blocks.grid().HeldOut(b)) continue;
    const double residual = blocks.observed_dn()[b] - expected.mean_dn[b];
    const double variance = variance_dn2[b];
    const double weight = StudentWeight(residual * residual / variance) / variance;
    const Eigen::VectorXd row = expected.jacobian_dn.row(b).transpose();
    hessian.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    gradient += weight * residual * row;
  }
  return {Eigen::MatrixXd(hessian.selfadjointView<Eigen::Lower>()), std::move(gradient)};
}

// The largest part of `step`, at most 1, that takes no more than half of a scale of the null model
// away: the scale of the laser stays positive.
double StepLength(const PathChoice& paths, const Eigen::VectorXd& factors,
                  const Eigen::VectorXd& step) {
  double length = 1;
  for (Eigen::Index k = 0; k < step.size(); ++k) {
    const LightPath& path = *paths[static_cast<size_t>(k)];
    if (path.nominal && !path.may_be_negative && step[k] < -0.5 * factors[k]) {
      length = std::min(length, -0.5 * factors[k] / step[k]);
    }
  }
  return length;
}

// Log densities and squared residuals of the blocks of the fit and of the held-out ones.
void AddDensities(const BlockGrid& grid, const Eigen::VectorXd& variance_dn2, PathFit* fit) {
  for (int b = 0; b < grid.count(); ++b) {
    const double z = fit->residuals[b];
    Evidence& terms = grid.HeldOut(b) ? fit->held_out : fit->evidence;
    terms.fit += LogStudentDensity(z);
    terms.covariance -= 0.5 * std::log(variance_dn2[b]);
    if (grid.HeldOut(b)) {
      fit->held_out_chi_squared += z * z;
      ++fit->held_out_count;
    } else {
      fit->chi_squared += z * z;
      ++fit->count;
    }
  }
}

// Log prior at the fitted factors. The 2 pi of prior and posterior cancel.
void AddLogPrior(const PathChoice& paths, const FactorPrior& prior, PathFit* fit) {
  double& log_prior = fit->evidence.parameter_prior;
  for (Eigen::Index k = 0; k < fit->factors.size(); ++k) {
    const double deviation = fit->factors[k] - prior.mean[k];
    log_prior +=
        -0.5 * deviation * deviation * prior.precision[k] + 0.5 * std::log(prior.precision[k]);
    if (paths[static_cast<size_t>(k)]->may_be_negative) continue;
    // Prior and posterior are both truncated at 0.
    log_prior += LogOfNormalDistribution(fit->factors[k] / std::sqrt(fit->covariance(k, k))) -
                 LogOfNormalDistribution(prior.mean[k] * std::sqrt(prior.precision[k]));
  }
  log_prior += LogSpecklePrior(fit->speckle_factor);
}

// The fit without truncation: factors may come out negative.
PathFit FitWithoutBounds(const BlockMeans& blocks, PathChoice paths) {
  const auto count = static_cast<Eigen::Index>(paths.size());
  const FactorPrior prior = PriorOf(paths);
  PathFit fit;
  fit.factors = prior.mean;
  Eigen::LDLT<Eigen::MatrixXd> information;
  ExpectedBlocks expected;
  Eigen::VectorXd variance_dn2;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    expected = blocks.Expect(paths, fit.factors);
    if (iteration < kSpeckleRounds) fit.speckle_factor = SpeckleFactor(blocks, expected);
    variance_dn2 = fit.speckle_factor * expected.speckle_variance_dn2 + expected.other_variance_dn2;
    const NormalEquations equations = Weighted(blocks, expected, variance_dn2, prior, fit.factors);
    information.compute(equations.hessian);
    const Eigen::VectorXd step = information.solve(equations.gradient);
    if (iteration >= kSpeckleRounds &&
        step.dot(equations.hessian * step) < kConvergedStep * static_cast<double>(count)) {
      break;
    }
    fit.factors += StepLength(paths, fit.factors, step) * step;
  }
  fit.covariance = information.solve(Eigen::MatrixXd::Identity(count, count));
  fit.mean_dn = expected.mean_dn;
  fit.residuals = (blocks.observed_dn() - expected.mean_dn).cwiseQuotient(variance_dn2.cwiseSqrt());
  AddDensities(blocks.grid(), variance_dn2, &fit);
  AddLogPrior(paths, prior, &fit);
  fit.evidence.curvature = -0.5 * information.vectorD().array().log().sum();
  fit.paths = std::move(paths);
  return fit;
}

// A fit without path `k` with that path added at factor 0 with this standard error. The marginal
// likelihood integrates over the part of the path's prior that lies within the error of 0, half of
// which is positive; the rest contradicts the recordings.
PathFit WithZeroFactor(PathFit fit, PathChoice paths, Eigen::Index k, double error) {
  const LightPath& path = *paths[static_cast<size_t>(k)];
  const double z = path.prior_mean / path.prior_standard_deviation;
  fit.evidence.parameter_prior += std::log(error / (2 * path.prior_standard_deviation)) -
                                  0.5 * z * z - LogOfNormalDistribution(z);
  const auto count = static_cast<Eigen::Index>(paths.size());
  Eigen::VectorXd factors = Eigen::VectorXd::Zero(count);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(count, count);
  for (Eigen::Index a = 0, from_a = 0; a < count; ++a) {
    if (a == k) continue;
    factors[a] = fit.factors[from_a];
    for (Eigen::Index b = 0, from_b = 0; b < count; ++b) {
      if (b == k) continue;
      covariance(a, b) = fit.covariance(from_a, from_b++);
    }
    ++from_a;
  }
  covariance(k, k) = error * error;
  fit.factors = std::move(factors);
  fit.covariance = std::move(covariance);
  fit.paths = std::move(paths);
  return fit;
}

}  // namespace

PathFit FitPaths(const BlockMeans& blocks, PathChoice paths) {
  PathFit fit = FitWithoutBounds(blocks, paths);
  for (size_t k = paths.size(); k-- > 0;) {
    const LightPath& path = *paths[k];
    const auto i = static_cast<Eigen::Index>(k);
    if (path.nominal || path.may_be_negative || fit.factors[i] >= 0) continue;
    PathChoice others = paths;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    return WithZeroFactor(FitPaths(blocks, std::move(others)), std::move(paths), i,
                          std::sqrt(fit.covariance(i, i)));
  }
  return fit;
}

}  // namespace sightline
