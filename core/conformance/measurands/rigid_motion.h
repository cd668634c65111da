// SPDX-License-Identifier: Apache-2.0
// Small rigid motions and sizes of surfaces, estimated from deviations of their targets.
//
// A motion is the twist (v, w): displacement v [m] of the frame's centre and rotation w, as the
// displacement [m] that it causes at the frame's scale L. It moves the point p by v + w x (p - c)/L
// and raises a surface there along its normal n by n . v + ((p - c)/L x n) . w.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "absl/status/status.h"
#include "core/conformance/characteristic.h"

namespace sightline {

using TwistRow = Eigen::Matrix<double, 1, 6>;

// The targets of a feature, and the reference frame of motions.
class MotionFrame {
 public:
  // `feature` must outlive it. The centre is that of the elements' targets.
  MotionFrame(const Feature& feature, std::span<const FeatureElement> elements);

  const Feature& feature() const { return feature_; }
  // Indices of the targets that estimates are made of; columns of all estimators are in this order.
  const std::vector<int>& used() const { return used_; }
  double scale_m() const { return scale_m_; }

  // Displacement of the point x along the direction d, as a function of the twist.
  TwistRow Displacement(const Eigen::Vector3d& x_m, const Eigen::Vector3d& d) const;
  // Deviation of a target of the element, along the outward normal of its nominal surface.
  TwistRow Deviation(const FeatureElement& element, int target) const;
  // The outward normal of the nominal surface at a target.
  Eigen::Vector3d Normal(const FeatureElement& element, int target) const;
  Eigen::Vector3d Centre(const FeatureElement& element) const;
  // Places of an element's used targets among used().
  std::vector<int> Columns(const FeatureElement& element) const;

 private:
  const Feature& feature_;
  std::vector<int> used_;
  std::vector<int> column_of_;  // of every target; -1: not used
  Eigen::Vector3d centre_m_ = Eigen::Vector3d::Zero();
  double scale_m_ = 1;
};

// Deviations [m] of an element's targets, one row each, that its sizes cause by a change of 1 m:
// radius of cylinder and sphere, half of a width, both radii of a torus, opening of a cone (as
// height at the frame's scale). No columns for planes and free-form surfaces.
Eigen::MatrixXd SizeColumns(const MotionFrame& frame, const FeatureElement& element,
                            std::span<const int> targets);

// A twist, as far as deviations h of the frame's used targets determine it.
struct MotionEstimate {
  Eigen::MatrixXd fixed = Eigen::MatrixXd(6, 0);  // orthonormal columns: determined motions
  Eigen::MatrixXd estimator;                      // 6 x used: twist = estimator h
  Eigen::MatrixXd sizes;                          // sizes x used, in the order of the last group
};

// A twist of which nothing is determined yet.
MotionEstimate UnknownMotion(const MotionFrame& frame);

// Fits the degrees of freedom that are not fixed yet to a group of elements that move as one, with
// or without the sizes of the elements: least squares on the deviations that the fixed degrees of
// freedom leave. FailedPrecondition: the used targets determine fewer degrees of freedom than all
// of the elements' targets do.
absl::Status FixRemaining(const MotionFrame& frame, std::span<const FeatureElement> group,
                          bool with_sizes, MotionEstimate& motion);

}  // namespace sightline
