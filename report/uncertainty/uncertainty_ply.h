// SPDX-License-Identifier: Apache-2.0
// Targets with their uncertainties, and error ellipsoids, as PLY files that point-cloud viewers
// read. Binary, little endian; metres, part coordinates.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

#include "absl/status/statusor.h"
#include "core/targets/target_set.h"
#include "report/uncertainty/target_uncertainty.h"

namespace sightline {

// One vertex per target: x, y, z, nx, ny, nz, red, green, blue, uncertainty_m, noise_m, sampling_m,
// calibration_m, admissible_m (float) and class (uchar, numbers of UncertaintyClass). The colour is
// the class's, as in the report. INVALID_ARGUMENT as CheckTargetUncertainties.
absl::StatusOr<std::string> UncertaintyPly(const TargetSet& targets,
                                           const TargetUncertainties& uncertainties,
                                           const TargetBits& measurable);

// Error of one point.
struct CovarianceEllipsoid {
  Eigen::Vector3d centre_m;
  Eigen::Matrix3d covariance_m2;  // symmetric, positive semidefinite
};

inline constexpr size_t kMostEllipsoids = 20'000;

// A closed mesh of 32 triangles per point, the image of a sphere under `scale` times the square
// root of its covariance: at scale 1 the vertices are one standard deviation from the point along
// their directions. Micrometres are invisible on a part of centimetres, so `scale`, in (0, 1e6], is
// recorded in the file's comments. Each vertex has x, y, z and largest_m, the standard deviation
// along the longest axis. INVALID_ARGUMENT names the ellipsoid and its field; it is also returned
// for more than kMostEllipsoids.
absl::StatusOr<std::string> CovarianceEllipsoidsPly(std::span<const CovarianceEllipsoid> ellipsoids,
                                                    double scale);

}  // namespace sightline
