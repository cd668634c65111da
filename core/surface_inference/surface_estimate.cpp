// SPDX-License-Identifier: Apache-2.0
#include "core/surface_inference/surface_estimate.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace sightline {

SurfaceWeights DenseSurfaceWeights(const SurfacePrior& prior,
                                   std::span<const std::vector<SurfaceObservation>> scans,
                                   std::span<const double> calibration_variances_m2) {
  assert(scans.size() == calibration_variances_m2.size());
  assert(prior.standard_deviation_m > 0 && prior.length_scale_m > 0);
  const double prior_m2 = prior.standard_deviation_m * prior.standard_deviation_m;
  const double exponent = -0.5 / (prior.length_scale_m * prior.length_scale_m);
  const double reach_m2 = prior.neighbourhood_m() * prior.neighbourhood_m();

  SurfaceWeights result;
  result.of_scans.assign(scans.size(), 0);
  std::vector<Eigen::Vector2d> places;
  std::vector<double> noise_m2;
  std::vector<size_t> scan_of, index_of;
  for (size_t s = 0; s < scans.size(); ++s) {
    result.of_points.emplace_back(scans[s].size(), 0.0);
    for (size_t i = 0; i < scans[s].size(); ++i) {
      if (!(scans[s][i].place_m.squaredNorm() <= reach_m2)) continue;
      assert(scans[s][i].noise_variance_m2 > 0);
      places.push_back(scans[s][i].place_m);
      noise_m2.push_back(scans[s][i].noise_variance_m2);
      scan_of.push_back(s);
      index_of.push_back(i);
    }
  }
  result.uncertainty = {prior.standard_deviation_m, 0, prior.standard_deviation_m, 0};
  const auto n = static_cast<Eigen::Index>(places.size());
  if (n == 0) return result;

  // Lower triangle only.
  Eigen::VectorXd with_target(n);
  Eigen::MatrixXd measured(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    with_target[j] = prior_m2 * std::exp(exponent * places[j].squaredNorm());
    measured(j, j) = prior_m2;
    for (Eigen::Index i = j + 1; i < n; ++i) {
      measured(i, j) = prior_m2 * std::exp(exponent * (places[i] - places[j]).squaredNorm());
    }
  }
  for (Eigen::Index j = 0; j < n; ++j) {
    measured(j, j) += noise_m2[j];
    for (Eigen::Index i = j; i < n && scan_of[i] == scan_of[j]; ++i) {
      measured(i, j) += calibration_variances_m2[scan_of[j]];
    }
  }
  const Eigen::VectorXd a = measured.llt().solve(with_target);
  double noise = 0, calibration = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    result.of_points[scan_of[i]][index_of[i]] = a[i];
    result.of_scans[scan_of[i]] += a[i];
    noise += a[i] * a[i] * noise_m2[i];
  }
  for (size_t s = 0; s < scans.size(); ++s) {
    calibration += calibration_variances_m2[s] * result.of_scans[s] * result.of_scans[s];
  }
  const double total = std::max(0.0, prior_m2 - a.dot(with_target));
  // The parts add up to the total: the rest after noise and calibration is sampling.
  const double sampling = std::max(0.0, total - noise - calibration);
  result.uncertainty = {std::sqrt(total), std::sqrt(noise), std::sqrt(sampling),
                        std::sqrt(calibration)};
  return result;
}

}  // namespace sightline
