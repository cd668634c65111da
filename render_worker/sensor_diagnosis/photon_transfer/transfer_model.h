// SPDX-License-Identifier: Apache-2.0
// The model of the photon transfer: mean and temporal variance of a step as functions of its
// light. It is the linear model of EMVA 1288 (Release 4.0 Linear, section 2) with optional
// terms.
//
// With e = eta p + I t electrons of a step of p photons and t seconds, and u = e / e_saturation:
//   mean      y = y_0 + K g(e),   g(e) = e (1 + b_2 u + b_3 u^2)                  [DN]
//   variance  s = (K g'(e))^2 (e (1 - c u) + sigma_d^2) + 1/12                    [DN^2]
// If exposure times are off by t_0 or stray light adds p_0 photons, p is replaced by
// p (1 + t_0 / t) + p_0.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "render_worker/sensor_diagnosis/flat_field_statistics.h"

namespace sightline {

// Variance of a number rounded to a step of one: a uniform distribution (EMVA 1288 R4.0, section
// 2.5) [DN^2].
inline constexpr double kQuantisationVariance_dn2 = 1.0 / 12;

// Optional terms of the linear model.
enum class TransferTerm {
  kQuadraticResponse,   // b_2
  kCubicResponse,       // b_3
  kBrighterFatter,      // c: charge pushes charge into neighbours, which reduces the variance
  kExposureTimeOffset,  // t_0
  kStrayLight,          // p_0, of bright frames only
};

// Index of every parameter in the parameter vector; -1: the model lacks it. Parameters are divided
// by `scale`, which brings them to the order of one.
struct TransferLayout {
  int gain = -1, efficiency = -1, dark_current = -1, black_level = -1, dark_variance = -1;
  int quadratic = -1, cubic = -1, brighter_fatter = -1, time_offset = -1, stray = -1;
  std::vector<double> scale;
  std::vector<std::pair<std::string, std::string>> name_and_unit;
};

// Means and variances of the fitted steps; one element per step.
struct TransferObservations {
  std::vector<const FlatFieldStatistics*> steps;
  std::vector<size_t> index;  // of the set's steps
  Eigen::VectorXd mean_dn, variance_dn2;
  Eigen::VectorXd noise_of_mean_dn, noise_of_variance_dn2;  // standard errors by temporal noise
  std::vector<double> photons;                              // 0 for dark steps
  double saturation_electrons = 1;
  double black_level_dn = 0;
  double black_level_deviation_dn = 0;  // standard deviation from frame to frame
  bool whole_photons = false;           // all are integers: they were rounded

  Eigen::Index size() const { return static_cast<Eigen::Index>(steps.size()); }
};

// Relative standard deviations of light and of variance between steps, in excess of temporal noise.
struct BetweenStepDeviation {
  double light = 0, variance = 0;
};

struct TransferMoments {
  Eigen::VectorXd mean_dn, variance_dn2;
};

// The model's means and variances for `scaled` parameters.
TransferMoments ExpectedMoments(const TransferObservations& data, const TransferLayout& layout,
                                const Eigen::VectorXd& scaled);

// Standard deviations of all means [DN], then of all variances [DN^2].
Eigen::VectorXd StandardDeviations(const TransferObservations& data,
                                   const BetweenStepDeviation& between_steps);

}  // namespace sightline
