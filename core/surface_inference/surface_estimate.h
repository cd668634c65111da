// SPDX-License-Identifier: Apache-2.0
// Estimate of the surface itself, not only of its uncertainty: the posterior mean that belongs to
// DenseSurfaceUncertainty, for analysing measured or simulated points.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/surface_inference/surface_inference.h"

namespace sightline {

// The estimate of the deviation at a target is linear in the points' deviations z along the
// target's normal: h = sum over scans and points of weights[scan][point] z. Points outside the
// neighbourhood have weight 0.
struct SurfaceWeights {
  std::vector<std::vector<double>> of_points;  // one list per scan
  std::vector<double> of_scans;                // sums over the points of a scan
  SurfaceUncertainty uncertainty;              // of the estimate
};

// By the dense matrices (thesis eq. 3.13, 3.14) with the scans' common errors; arguments as of
// DenseSurfaceUncertainty. The sums of a scan give the effect of an error common to its points.
SurfaceWeights DenseSurfaceWeights(const SurfacePrior& prior,
                                   std::span<const std::vector<SurfaceObservation>> scans,
                                   std::span<const double> calibration_variances_m2);

}  // namespace sightline
