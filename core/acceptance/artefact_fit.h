// SPDX-License-Identifier: Apache-2.0
// Quantities of acceptance tests from fitted surfaces: errors of size, form and distance.
#pragma once

#include <Eigen/Core>
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

// Least-squares surfaces (core/association) through the points of every surface of the artefact,
// and the errors by them in the order of AcceptanceQuantities() of its kind [m]. Empty: points that
// do not determine a surface.
std::vector<double> FittedErrors(const Artefact& artefact,
                                 const std::vector<SurfacePoints>& points);

// The same to first order, for deviations of the points along their normals.
class LinearFit {
 public:
  // Places that are not all on a line, at least as many as parameters.
  LinearFit(const ArtefactSurface& surface, const std::vector<Eigen::Vector3d>& positions_m,
            const std::vector<Eigen::Vector3d>& normals);

  // Changes of the parameters by deviations, a column each.
  Eigen::MatrixXd Parameters(const Eigen::MatrixXd& deviations_m) const;
  // Deviations that the fit leaves.
  Eigen::MatrixXd Residuals(const Eigen::MatrixXd& deviations_m) const;
  // Sums over the points of squared sensitivities times variances: variance of a parameter
  // combination by independent deviations.
  double Variance(const Eigen::VectorXd& combination, const Eigen::VectorXd& variances_m2) const;
  // Combination of the parameters that is the diameter, or the displacement of a sphere's centre
  // along a direction.
  Eigen::VectorXd Diameter() const;
  Eigen::VectorXd Displacement(const Eigen::Vector3d& direction) const;

 private:
  SurfaceKind kind_;
  Eigen::MatrixXd design_;   // deviations = design * parameters
  Eigen::MatrixXd inverse_;  // pseudo-inverse of the design
};

}  // namespace sightline
