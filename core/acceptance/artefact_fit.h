// SPDX-License-Identifier: Apache-2.0
// Evaluates acceptance tests by fitted surfaces: errors of size, form and distance.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "core/acceptance/artefact.h"

namespace sightline {

// Quantities of ISO 10360-13 and VDI/VDE 2634-2. Form errors are the narrowest range that holds
// 95 % or 99.7 % of the distances of the points from the fitted surface.
enum class AcceptanceQuantityKind {
  kProbingSize,
  kProbingForm95,
  kProbingForm997,
  kSphereDistance,
  kFlatness95,
  kFlatness997,
  kRingDiameter,
  kHoleDistance,
};

struct AcceptanceQuantityInfo {
  AcceptanceQuantityKind kind;
  ArtefactKind artefact;
  const char* name;      // in files
  const char* standard;  // and its symbol there
  const char* title;     // for people
};
std::span<const AcceptanceQuantityInfo> AcceptanceQuantities();
bool IsForm(AcceptanceQuantityKind kind);

// Narrowest range that holds the fraction of the values, in any order. At least one value.
double NarrowestRange(std::vector<double> values, double fraction);

// Points of one surface of an artefact.
struct SurfacePoints {
  std::vector<Eigen::Vector3d> positions_m;
  std::vector<Eigen::Vector3d> normals;  // of the nominal surface
};

// Fits every surface of the artefact to its points by least squares (core/association) and returns
// the errors [m] in the order of AcceptanceQuantities() of its kind. Empty: the points do not
// determine a surface. A hole pattern has the points of its bores in the first set-up, then
// those at the same positions in the second.
std::vector<double> FittedErrors(const Artefact& artefact,
                                 const std::vector<SurfacePoints>& points);

// Linear weights of the distance between bore 0 (first set-up) and bore 2 (second set-up) of a hole
// pattern. The set-ups are joined by the best fit of all four axes, a shift and a turn across them.
// The error of the distance is the sum over set-ups s and positions b of w_sb . displacement of the
// axis' middle [m].
struct HolePatternWeights {
  // [set-up][place]; across the bores' axis.
  std::array<std::array<Eigen::Vector3d, 4>, 2> all;
  // The part of the weights that joining the set-ups causes.
  std::array<std::array<Eigen::Vector3d, 4>, 2> joining;
};
HolePatternWeights WeightsOfHolePattern(const Artefact& pattern);

// Independent random error of one point: it moves by first_m e + second_m e^2 / 2 with e of mean 0
// and variance 1.
struct PointNoise {
  size_t point = 0;
  Eigen::Vector3d first_m, second_m;
};

// First-order (linearised) fit of a surface to deviations of points along their normals.
class LinearFit {
 public:
  // Needs at least as many points as parameters, not all on one line.
  LinearFit(const ArtefactSurface& surface, const std::vector<Eigen::Vector3d>& positions_m,
            const std::vector<Eigen::Vector3d>& normals);

  // Changes of the parameters; one column per column of deviations.
  Eigen::MatrixXd Parameters(const Eigen::MatrixXd& deviations_m) const;
  // Residuals of the fit.
  Eigen::MatrixXd Residuals(const Eigen::MatrixXd& deviations_m) const;
  // Variance of a combination of parameters for independent deviations: sum over the points of
  // squared sensitivity times variance.
  double Variance(const Eigen::VectorXd& combination, const Eigen::VectorXd& variances_m2) const;
  // Mean change of the parameters by random errors of the points, to second order. Least squares
  // are biased where the surface is curved: an error along the line of sight moves the point along
  // the surface too, so that its distance grows by e^2 t' H t / 2, with t = first_m and the Hessian
  // H of the distance, and its normal turns by e H t in step with the distance e n . t. With the
  // rows a_i of the design, their derivatives m_i along t_i and A = sum a_i a_i' the mean is
  //   A^-1 sum_i [a_i (t_i' H_i t_i + n_i . second_i) / 2 + m_i (n_i . t_i)].
  // Terms of the order of A^-1 a_i a_i' are left out.
  Eigen::VectorXd MeanChange(std::span<const PointNoise> noise) const;
  // Combinations of parameters: the diameter, or the displacement of a sphere's centre or of the
  // middle of a bore's axis along a direction.
  Eigen::VectorXd Diameter() const;
  Eigen::VectorXd Displacement(const Eigen::Vector3d& direction) const;

 private:
  ArtefactSurface surface_;
  std::vector<Eigen::Vector3d> positions_m_, normals_;
  SurfaceKind kind_;
  Eigen::Vector3d u_, v_;           // across the axis
  Eigen::MatrixXd design_;          // deviations = design * parameters
  Eigen::MatrixXd normal_inverse_;  // of the design's normal equations
  Eigen::MatrixXd inverse_;         // pseudo-inverse of the design
};

}  // namespace sightline
