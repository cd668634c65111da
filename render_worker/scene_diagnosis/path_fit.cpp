// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/path_fit.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace sightline {
namespace {

constexpr double kTail = 6;  // degrees of freedom of Student's law
constexpr int kMaxIterations = 25;
// The speckle's factor is found along with the first iterations, then kept so that they converge.
constexpr int kSpeckleRounds = 6;

// Log density of Student's law with unit variance.
double LogStudent(double z) {
  return std::lgamma((kTail + 1) / 2) - std::lgamma(kTail / 2) -
         0.5 * std::log((kTail - 2) * std::numbers::pi) -
         (kTail + 1) / 2 * std::log1p(z * z / (kTail - 2));
}

// log of the standard normal distribution function.
double LogNormalBelow(double x) {
  if (x < -30) return -0.5 * x * x - std::log(-x) - 0.5 * std::log(2 * std::numbers::pi);
  return std::log(0.5 * std::erfc(-x / std::numbers::sqrt2));
}

// Factor of the speckle's variance, of a fine grid, that the blocks used for the fit like best,
// with a log-normal prior of this width.
constexpr double kSpecklePrior = 0.7, kSpeckleStep = 0.1;
constexpr int kSpeckleSteps = 25;  // e^-2.5 to e^2.5
double LogSpecklePrior(double factor) {
  const double z = std::log(factor) / kSpecklePrior;
  return -0.5 * z * z;
}
double BestSpeckleFactor(const BlockMeans& blocks, const ExpectedBlocks& expected) {
  double best = 1, best_density = -std::numeric_limits<double>::infinity();
  for (int step = -kSpeckleSteps; step <= kSpeckleSteps; ++step) {
    const double factor = std::exp(kSpeckleStep * step);
    double density = LogSpecklePrior(factor);
    for (int b = 0; b < blocks.count(); ++b) {
      if (blocks.HeldOut(b)) continue;
      const double variance =
          factor * expected.speckle_variance_dn2[b] + expected.other_variance_dn2[b];
      density += LogStudent((blocks.observed_dn()[b] - expected.mean_dn[b]) / std::sqrt(variance)) -
                 0.5 * std::log(variance);
    }
    if (density <= best_density) continue;
    best_density = density;
    best = factor;
  }
  return best;
}

}  // namespace

namespace {

// Factors may come out negative.
PathFit FitFreely(const BlockMeans& blocks, PathChoice paths) {
  const auto count = static_cast<Eigen::Index>(paths.size());
  Eigen::VectorXd prior_mean(count), prior_precision(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    prior_mean[k] = paths[static_cast<size_t>(k)]->prior_mean;
    prior_precision[k] = 1 / std::pow(paths[static_cast<size_t>(k)]->prior_standard_deviation, 2);
  }
  PathFit fit;
  fit.factors = prior_mean;
  Eigen::LDLT<Eigen::MatrixXd> normal;
  ExpectedBlocks expected;
  Eigen::VectorXd variance_dn2;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    expected = blocks.Expect(paths, fit.factors);
    if (iteration < kSpeckleRounds) fit.speckle_factor = BestSpeckleFactor(blocks, expected);
    variance_dn2 = fit.speckle_factor * expected.speckle_variance_dn2 + expected.other_variance_dn2;
    Eigen::MatrixXd hessian = prior_precision.asDiagonal();
    Eigen::VectorXd gradient = -prior_precision.cwiseProduct(fit.factors - prior_mean);
    for (int b = 0; b < blocks.count(); ++b) {
      if (blocks.HeldOut(b)) continue;
      const double residual = blocks.observed_dn()[b] - expected.mean_dn[b];
      const double variance = variance_dn2[b];
      const double weight = (kTail + 1) / (kTail - 2 + residual * residual / variance) / variance;
      const Eigen::VectorXd row = expected.jacobian_dn.row(b).transpose();
      hessian.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
      gradient += weight * residual * row;
    }
    hessian = Eigen::MatrixXd(hessian.selfadjointView<Eigen::Lower>());
    normal.compute(hessian);
    const Eigen::VectorXd step = normal.solve(gradient);
    if (iteration >= kSpeckleRounds &&
        step.dot(hessian * step) < 1e-6 * static_cast<double>(count)) {
      break;
    }
    // The scale of the laser stays positive: half of it at most a step.
    double length = 1;
    for (Eigen::Index k = 0; k < count; ++k) {
      const LightPath& path = *paths[static_cast<size_t>(k)];
      if (path.nominal && !path.may_be_negative && step[k] < -0.5 * fit.factors[k]) {
        length = std::min(length, -0.5 * fit.factors[k] / step[k]);
      }
    }
    fit.factors += length * step;
  }
  fit.covariance = normal.solve(Eigen::MatrixXd::Identity(count, count));

  fit.mean_dn = expected.mean_dn;
  fit.residuals = (blocks.observed_dn() - expected.mean_dn).cwiseQuotient(variance_dn2.cwiseSqrt());
  for (int b = 0; b < blocks.count(); ++b) {
    const double z = fit.residuals[b];
    const double density = LogStudent(z) - 0.5 * std::log(variance_dn2[b]);
    if (blocks.HeldOut(b)) {
      fit.held_out_log_density += density;
      fit.held_out_chi_squared += z * z;
      ++fit.held_out_count;
    } else {
      fit.log_evidence += density;
      fit.chi_squared += z * z;
      ++fit.count;
    }
  }
  for (Eigen::Index k = 0; k < count; ++k) {
    const double deviation = fit.factors[k] - prior_mean[k];
    // The 2 pi of prior and posterior cancel.
    fit.log_evidence +=
        -0.5 * deviation * deviation * prior_precision[k] + 0.5 * std::log(prior_precision[k]);
    const LightPath& path = *paths[static_cast<size_t>(k)];
    if (path.may_be_negative) continue;
    // Both are cut at 0.
    fit.log_evidence += LogNormalBelow(fit.factors[k] / std::sqrt(fit.covariance(k, k))) -
                        LogNormalBelow(prior_mean[k] * std::sqrt(prior_precision[k]));
  }
  fit.log_evidence += LogSpecklePrior(fit.speckle_factor);
  fit.log_evidence -= 0.5 * normal.vectorD().array().log().sum();
  fit.paths = std::move(paths);
  return fit;
}

}  // namespace

PathFit FitPaths(const BlockMeans& blocks, PathChoice paths) {
  PathFit fit = FitFreely(blocks, paths);
  // Light that would have to be negative is not there.
  for (size_t k = paths.size(); k-- > 0;) {
    const LightPath& path = *paths[k];
    const auto i = static_cast<Eigen::Index>(k);
    if (path.nominal || path.may_be_negative || fit.factors[i] >= 0) continue;
    const double error = std::sqrt(fit.covariance(i, i));
    PathChoice others = paths;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(k));
    PathFit without = FitPaths(blocks, std::move(others));
    // Of the prior, only what lies within the error of 0 agrees with the recordings.
    const double z = path.prior_mean / path.prior_standard_deviation;
    without.log_evidence +=
        std::log(error / (2 * path.prior_standard_deviation)) - 0.5 * z * z - LogNormalBelow(z);
    // The path stays listed, with factor 0.
    const auto count = static_cast<Eigen::Index>(paths.size());
    Eigen::VectorXd factors = Eigen::VectorXd::Zero(count);
    Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(count, count);
    for (Eigen::Index a = 0, from_a = 0; a < count; ++a) {
      if (a == i) continue;
      factors[a] = without.factors[from_a];
      for (Eigen::Index b = 0, from_b = 0; b < count; ++b) {
        if (b == i) continue;
        covariance(a, b) = without.covariance(from_a, from_b++);
      }
      ++from_a;
    }
    covariance(i, i) = error * error;
    without.factors = std::move(factors);
    without.covariance = std::move(covariance);
    without.paths = std::move(paths);
    return without;
  }
  return fit;
}

}  // namespace sightline
