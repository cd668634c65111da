// SPDX-License-Identifier: Apache-2.0
// The reference by dense matrices, and the length scale.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

#include "core/surface_inference/surface_inference.h"

namespace sightline {

double CovarianceLengthScale(double resolution_m) {
  assert(resolution_m > 0);
  // With f_c = 1 / (2 delta_r) and z = sqrt(2) pi l f_c, eq. 3.22 is proportional to
  // z exp(-z^2) erf(z), largest at z = 0.88770; l = sqrt(2) z delta_r / pi.
  return 1.2554 * resolution_m / std::numbers::pi;
}

SurfaceUncertainty DenseSurfaceUncertainty(const SurfacePrior& prior,
                                           std::span<const std::vector<SurfaceObservation>> scans,
                                           std::span<const double> calibration_variances_m2) {
  assert(scans.size() == calibration_variances_m2.size());
  assert(prior.standard_deviation_m > 0 && prior.length_scale_m > 0);
  std::vector<SurfaceObservation> points;
  std::vector<size_t> scan_of;
  for (size_t s = 0; s < scans.size(); ++s) {
    for (const SurfaceObservation& point : scans[s]) {
      if (!(point.place_m.norm() <= prior.neighbourhood_m())) continue;
      assert(point.noise_variance_m2 > 0);
      points.push_back(point);
      scan_of.push_back(s);
    }
  }
  const auto size = static_cast<Eigen::Index>(points.size());
  if (size == 0) return {prior.standard_deviation_m, 0, prior.standard_deviation_m, 0};
  const double prior_m2 = prior.standard_deviation_m * prior.standard_deviation_m;
  const auto covariance = [&](const Eigen::Vector2d& apart_m) {
    const double l2 = prior.length_scale_m * prior.length_scale_m;
    return prior_m2 * std::exp(-apart_m.squaredNorm() / (2 * l2));
  };
  Eigen::VectorXd with_target(size);
  Eigen::MatrixXd surface(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    with_target[i] = covariance(points[i].place_m);
    for (Eigen::Index j = 0; j < size; ++j) {
      surface(i, j) = covariance(points[i].place_m - points[j].place_m);
    }
  }
  Eigen::MatrixXd measured = surface;
  for (Eigen::Index i = 0; i < size; ++i) {
    measured(i, i) += points[i].noise_variance_m2;
    for (Eigen::Index j = 0; j < size; ++j) {
      if (scan_of[i] == scan_of[j]) measured(i, j) += calibration_variances_m2[scan_of[i]];
    }
  }
  const Eigen::VectorXd a = measured.llt().solve(with_target);
  // Variance of the error h(0) - sum a_i z_i.
  const double sampling = std::max(0.0, prior_m2 - 2 * a.dot(with_target) + a.dot(surface * a));
  double noise = 0;
  std::vector<double> sums(scans.size(), 0.0);
  for (Eigen::Index i = 0; i < size; ++i) {
    noise += a[i] * a[i] * points[i].noise_variance_m2;
    sums[scan_of[i]] += a[i];
  }
  double calibration = 0;
  for (size_t s = 0; s < scans.size(); ++s) {
    calibration += calibration_variances_m2[s] * sums[s] * sums[s];
  }
  const double total = std::max(0.0, prior_m2 - a.dot(with_target));
  return {std::sqrt(total), std::sqrt(noise), std::sqrt(sampling), std::sqrt(calibration)};
}

}  // namespace sightline
