// SPDX-License-Identifier: Apache-2.0
// Factors of light paths from block means, by maximum a posteriori, with their marginal likelihood.
//
// Residuals of blocks follow Student's t with 6 degrees of freedom, factors their normal priors
// (truncated at 0 for light), and the variance of speckle a log-normal prior. The maximum is found
// by iteratively reweighted least squares; the marginal likelihood by Laplace's approximation from
// the blocks of the fit, the predictive density at the fitted factors from the held-out blocks.
#pragma once

#include <Eigen/Core>

#include "render_worker/evidence/evidence.h"
#include "render_worker/scene_diagnosis/block/block_means.h"

namespace sightline {

struct PathFit {
  PathChoice paths;
  Eigen::VectorXd factors;
  Eigen::MatrixXd covariance;
  // Variance of speckle over that of fully developed speckle of an evenly lit surface: lines out of
  // focus have longer speckle, depolarised light has less of it.
  double speckle_factor = 1;
  // Marginal likelihood of the blocks of the fit. Its term `fit` is the log density of Student's t
  // of the standardised residuals, its term `parameter_prior` contains the truncation at 0.
  Evidence evidence;
  // Log predictive density of the held-out blocks at the fitted factors: `fit` and `covariance`.
  Evidence held_out;
  double chi_squared = 0, held_out_chi_squared = 0;
  int count = 0, held_out_count = 0;  // blocks of the fit, and held-out ones
  Eigen::VectorXd residuals;          // of all blocks, over their standard deviations
  Eigen::VectorXd mean_dn;            // of all blocks

  double HeldOutLogDensity() const { return held_out.LogMarginalLikelihood(); }
  double LogPredictive() const { return evidence.LogMarginalLikelihood() + HeldOutLogDensity(); }
  double HeldOutChiSquaredPerDegree() const { return held_out_chi_squared / held_out_count; }
};

// Negative factors of light are set to 0. Such a path stays in the list, and the marginal
// likelihood accounts for the part of its prior near 0.
PathFit FitPaths(const BlockMeans& blocks, PathChoice paths);

}  // namespace sightline
