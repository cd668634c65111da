// SPDX-License-Identifier: Apache-2.0
// Fits of characteristics, one file per kind. All take the frame of the feature's targets and the
// characteristic; FitCharacteristic calls the fit of its kind. Errors as FitCharacteristic.
#pragma once

#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/conformance/characteristic.h"
#include "core/conformance/measurands/rigid_motion.h"

namespace sightline {

// Flatness, straightness, roundness, cylindricity: range of the residuals of the fit of each
// surface. Straightness and roundness are evaluated for all lines and sections together, which is
// an upper bound for each. With the association kChebyshev, the width of the minimum zone.
absl::StatusOr<CharacteristicFit> FitForm(const MotionFrame& frame, const Characteristic& c);

// Profiles: deviation of every target from the model in the datum system. With the association
// kChebyshev, twice the largest |deviation| after the motion that minimises it.
absl::StatusOr<CharacteristicFit> FitProfile(const MotionFrame& frame, const Characteristic& c);

// Position, coaxiality, concentricity, symmetry: displacement of an axis at its ends, of a centre
// or of a median plane at its edges, in the worst direction, relative to the datum system. With a
// material requirement, minus the bonus of the surface's own size (ISO 2692).
absl::StatusOr<CharacteristicFit> FitPosition(const MotionFrame& frame, const Characteristic& c);

// Parallelism, perpendicularity, angularity: fall of axis or plane over the surface relative to the
// datum system, in the worst direction.
absl::StatusOr<CharacteristicFit> FitOrientation(const MotionFrame& frame, const Characteristic& c);

// Circular and total run-out: range of deviations about the axis of the datum system, with the
// offset of each surface fitted out, and for circular run-out its slope along the axis too. The
// value of all sections together bounds that of each.
absl::StatusOr<CharacteristicFit> FitRunout(const MotionFrame& frame, const Characteristic& c);

// Diameters, radii, widths and distances between two surfaces.
absl::StatusOr<CharacteristicFit> FitSize(const MotionFrame& frame, const Characteristic& c);

// The angle of a cone, or between two planes, as arcs.
absl::StatusOr<CharacteristicFit> FitAngle(const MotionFrame& frame, const Characteristic& c);

// Estimates and extents that several kinds use.

// The motion of the datum system. The degrees of freedom that the datums leave are fitted to the
// toleranced surfaces with their sizes if `remaining_with_sizes`, else without.
absl::StatusOr<MotionEstimate> DatumMotion(const MotionFrame& frame, const Characteristic& c,
                                           bool remaining_with_sizes);

// Stacked estimates of single surfaces: for each its twist (6 rows), then its sizes; at the end, if
// given, the twist of the datum system.
struct StackedEstimates {
  Eigen::MatrixXd estimator;
  std::vector<Eigen::Index> first_row;  // of each surface; then of the datum system
  Eigen::Index size_row(size_t surface) const { return first_row[surface] + 6; }
};
absl::StatusOr<StackedEstimates> EachByItself(const MotionFrame& frame,
                                              std::span<const FeatureElement> elements,
                                              const MotionEstimate* datum);

// All toleranced targets, in the order of the elements.
std::vector<int> TolerancedTargets(const Characteristic& c);

// Extent of the element's targets along the unit vector d [m]; 0 without targets.
double ExtentAlong(const MotionFrame& frame, const FeatureElement& element,
                   const Eigen::Vector3d& d);

// True if material surrounds the surface: a bore or slot, not a pin or wall.
bool IsInner(const MotionFrame& frame, const FeatureElement& element);

// Growth of half the size of a cylinder, sphere or width per unit of its column of SizeColumns: -1
// for a slot, which gets narrower where its planes rise out of the material.
double HalfSizePerColumn(const MotionFrame& frame, const FeatureElement& element);

// Unit vectors over a whole turn across an axis, every 5 degrees.
std::vector<Eigen::Vector3d> DirectionsAcross(const Eigen::Vector3d& axis);

// Matrix of the rows, one below the other; each has `columns` numbers.
Eigen::MatrixXd RowsToMatrix(const std::vector<Eigen::RowVectorXd>& rows, Eigen::Index columns);

}  // namespace sightline
