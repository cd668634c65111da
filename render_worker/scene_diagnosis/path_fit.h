// SPDX-License-Identifier: Apache-2.0
// Factors of light paths from block means, with their evidence.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/scene_diagnosis/block_means.h"

namespace sightline {

struct PathFit {
  PathChoice paths;
  Eigen::VectorXd factors;
  Eigen::MatrixXd covariance;
  // Variance of speckle over that of fully developed speckle of an evenly lit surface: lines out of
  // focus have longer speckle, depolarised light has less of it.
  double speckle_factor = 1;
  // Laplace's approximation, from the blocks used for the fit [nats].
  double log_evidence = 0;
  // Log density of the held-out blocks at the fitted factors [nats].
  double held_out_log_density = 0;
  double chi_squared = 0, held_out_chi_squared = 0;
  int count = 0, held_out_count = 0;
  Eigen::VectorXd residuals;  // of all blocks, over their standard deviations
  Eigen::VectorXd mean_dn;    // of all blocks

  double LogPredictive() const { return log_evidence + held_out_log_density; }
};

// Maximum of the posterior by reweighted least squares. Residuals follow Student's law with 6
// degrees of freedom: block means of speckle have longer tails than normal ones. Factors of light
// that would come out negative are 0.
PathFit FitPaths(const BlockMeans& blocks, PathChoice paths);

}  // namespace sightline
