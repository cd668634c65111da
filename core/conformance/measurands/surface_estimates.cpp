// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "absl/strings/str_cat.h"
#include "core/conformance/measurands/measurands.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Rigid motions that change the place of a surface.
Eigen::Index FreedomsOf(SurfaceKind kind) {
  switch (kind) {
    case SurfaceKind::kFreeform:
      return 0;
    case SurfaceKind::kPlane:
    case SurfaceKind::kSphere:
      return 3;
    case SurfaceKind::kCylinder:
      return 4;
    case SurfaceKind::kCone:
    case SurfaceKind::kTorus:
      return 5;
  }
  return 0;
}

}  // namespace

absl::StatusOr<MotionEstimate> DatumMotion(const MotionFrame& frame, const Characteristic& c,
                                           bool remaining_with_sizes) {
  MotionEstimate motion = UnknownMotion(frame);
  if (c.exact_datum) return motion;
  for (const std::vector<FeatureElement>& datum : c.datums) {
    SIGHTLINE_RETURN_IF_ERROR(FixRemaining(frame, datum, true, motion));
  }
  SIGHTLINE_RETURN_IF_ERROR(FixRemaining(frame, c.elements, remaining_with_sizes, motion));
  return motion;
}

absl::StatusOr<StackedEstimates> EachByItself(const MotionFrame& frame,
                                              std::span<const FeatureElement> elements,
                                              const MotionEstimate* datum) {
  StackedEstimates stacked;
  std::vector<Eigen::MatrixXd> blocks;
  Eigen::Index rows = 0;
  for (const FeatureElement& element : elements) {
    MotionEstimate own = UnknownMotion(frame);
    SIGHTLINE_RETURN_IF_ERROR(FixRemaining(frame, {&element, 1}, true, own));
    if (own.fixed.cols() < FreedomsOf(element.surface.kind)) {
      return absl::FailedPreconditionError(
          absl::StrCat("its ", element.targets.size(), " targets do not determine the ",
                       SurfaceKindName(element.surface.kind), " that they lie on"));
    }
    stacked.first_row.push_back(rows);
    blocks.push_back(own.estimator);
    blocks.push_back(own.sizes);
    rows += own.estimator.rows() + own.sizes.rows();
  }
  stacked.first_row.push_back(rows);
  if (datum != nullptr) blocks.push_back(datum->estimator), rows += 6;
  stacked.estimator.resize(rows, static_cast<Eigen::Index>(frame.used().size()));
  Eigen::Index row = 0;
  for (const Eigen::MatrixXd& block : blocks) {
    stacked.estimator.middleRows(row, block.rows()) = block;
    row += block.rows();
  }
  return stacked;
}

std::vector<int> TolerancedTargets(const Characteristic& c) {
  std::vector<int> targets;
  for (const FeatureElement& element : c.elements) {
    targets.insert(targets.end(), element.targets.begin(), element.targets.end());
  }
  return targets;
}

double ExtentAlong(const MotionFrame& frame, const FeatureElement& element,
                   const Eigen::Vector3d& d) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const int t : element.targets) {
    const double s = d.dot(frame.feature().targets[static_cast<size_t>(t)].position_m);
    low = std::min(low, s);
    high = std::max(high, s);
  }
  return high > low ? high - low : 0;
}

bool IsInner(const MotionFrame& frame, const FeatureElement& element) {
  if (element.targets.empty()) return false;
  const FeatureTarget& target =
      frame.feature().targets[static_cast<size_t>(element.targets.front())];
  const Eigen::Vector3d outward =
      element.width ? Eigen::Vector3d(target.position_m - frame.Centre(element))
                    : DistanceGradient(element.surface, target.position_m, target.normal);
  return outward.dot(target.normal) < 0;
}

double HalfSizePerColumn(const MotionFrame& frame, const FeatureElement& element) {
  return element.width && IsInner(frame, element) ? -1 : 1;
}

std::vector<Eigen::Vector3d> DirectionsAcross(const Eigen::Vector3d& axis) {
  constexpr int kDirectionsOfTurn = 72;
  const Eigen::Vector3d across = axis.unitOrthogonal(), other = axis.cross(across);
  std::vector<Eigen::Vector3d> directions;
  for (int k = 0; k < kDirectionsOfTurn; ++k) {
    const double angle = 2 * std::numbers::pi * k / kDirectionsOfTurn;
    directions.emplace_back(std::cos(angle) * across + std::sin(angle) * other);
  }
  return directions;
}

Eigen::MatrixXd RowsToMatrix(const std::vector<Eigen::RowVectorXd>& rows, Eigen::Index columns) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(rows.size()), columns);
  for (size_t k = 0; k < rows.size(); ++k) matrix.row(static_cast<Eigen::Index>(k)) = rows[k];
  return matrix;
}

}  // namespace sightline
