// SPDX-License-Identifier: Apache-2.0
#include "core/conformance/measurands/rigid_motion.h"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Motions that displace the targets along their normals by less than this fraction of themselves
// (root mean square) do not move the surface; rounding of single precision is below 1e-7.
constexpr double kUnmoved = 1e-6;

// Rigid rows and size columns of a group's targets; row k belongs to columns[k] of estimators.
struct GroupDesign {
  std::vector<int> columns;
  MatrixXd rigid, sizes;
};

GroupDesign DesignOf(const MotionFrame& frame, std::span<const FeatureElement> group,
                     bool with_sizes, bool used_only) {
  std::vector<std::vector<int>> targets;
  Eigen::Index rows = 0, size_count = 0;
  std::vector<MatrixXd> blocks;
  GroupDesign design;
  for (const FeatureElement& element : group) {
    std::vector<int>& chosen = targets.emplace_back();
    for (const int t : element.targets) {
      if (!used_only || frame.feature().targets[static_cast<size_t>(t)].used()) chosen.push_back(t);
    }
    if (used_only) {
      const std::vector<int> columns = frame.Columns(element);
      design.columns.insert(design.columns.end(), columns.begin(), columns.end());
    }
    rows += static_cast<Eigen::Index>(chosen.size());
    blocks.push_back(with_sizes ? SizeColumns(frame, element, chosen)
                                : MatrixXd(static_cast<Eigen::Index>(chosen.size()), 0));
    size_count += blocks.back().cols();
  }
  design.rigid.resize(rows, 6);
  design.sizes = MatrixXd::Zero(rows, size_count);
  Eigen::Index row = 0, column = 0;
  for (size_t e = 0; e < group.size(); ++e) {
    design.sizes.block(row, column, blocks[e].rows(), blocks[e].cols()) = blocks[e];
    column += blocks[e].cols();
    for (const int t : targets[e]) design.rigid.row(row++) = frame.Deviation(group[e], t);
  }
  return design;
}

// Left inverse by least squares, of full column rank or of the smallest norm.
MatrixXd LeastSquares(const MatrixXd& a) {
  if (a.cols() == 0) return MatrixXd(0, a.rows());
  return a.completeOrthogonalDecomposition().pseudoInverse();
}

// Motions `free` (6 x k) as a group sees them with its sizes fitted out.
struct Sight {
  MatrixXd size_inverse;  // sizes x rows
  Eigen::BDCSVD<MatrixXd> svd;
  Eigen::Index rank = 0;
};

Sight SightOf(const GroupDesign& design, const MatrixXd& free) {
  Sight sight;
  MatrixXd seen = design.rigid * free;
  sight.size_inverse = LeastSquares(design.sizes);
  seen -= design.sizes * (sight.size_inverse * seen);
  if (seen.rows() == 0 || seen.cols() == 0) return sight;
  sight.svd.compute(seen, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const double unmoved = kUnmoved * std::sqrt(static_cast<double>(seen.rows()));
  sight.rank = (sight.svd.singularValues().array() > unmoved).count();
  return sight;
}

// Orthonormal basis of what is orthogonal to the orthonormal columns.
MatrixXd Complement(const MatrixXd& columns) {
  if (columns.cols() == 0) return MatrixXd::Identity(6, 6);
  const Eigen::HouseholderQR<MatrixXd> qr(columns);
  const MatrixXd q = qr.householderQ() * MatrixXd::Identity(6, 6);
  return q.rightCols(6 - columns.cols());
}

}  // namespace

MotionFrame::MotionFrame(const Feature& feature, std::span<const FeatureElement> elements)
    : feature_(feature), column_of_(feature.targets.size(), -1) {
  for (size_t t = 0; t < feature.targets.size(); ++t) {
    if (!feature.targets[t].used()) continue;
    column_of_[t] = static_cast<int>(used_.size());
    used_.push_back(static_cast<int>(t));
  }
  double count = 0;
  for (const FeatureElement& element : elements) {
    for (const int t : element.targets) {
      centre_m_ += feature.targets[static_cast<size_t>(t)].position_m;
      ++count;
    }
  }
  if (count > 0) centre_m_ /= count;
  scale_m_ = 0;
  for (const FeatureTarget& target : feature.targets) {
    scale_m_ = std::max(scale_m_, (target.position_m - centre_m_).norm());
  }
  if (!(scale_m_ > 0)) scale_m_ = 1;
}

TwistRow MotionFrame::Displacement(const Vector3d& x_m, const Vector3d& d) const {
  TwistRow row;
  row << d.transpose(), ((x_m - centre_m_) / scale_m_).cross(d).transpose();
  return row;
}

Vector3d MotionFrame::Normal(const FeatureElement& element, int target) const {
  const FeatureTarget& t = feature_.targets[static_cast<size_t>(target)];
  const Vector3d gradient = DistanceGradient(element.surface, t.position_m, t.normal);
  return gradient.dot(t.normal) < 0 ? Vector3d(-gradient) : gradient;
}

TwistRow MotionFrame::Deviation(const FeatureElement& element, int target) const {
  return Displacement(feature_.targets[static_cast<size_t>(target)].position_m,
                      Normal(element, target));
}

Vector3d MotionFrame::Centre(const FeatureElement& element) const {
  Vector3d sum = Vector3d::Zero();
  for (const int t : element.targets) sum += feature_.targets[static_cast<size_t>(t)].position_m;
  return sum / static_cast<double>(std::max<size_t>(1, element.targets.size()));
}

std::vector<int> MotionFrame::Columns(const FeatureElement& element) const {
  std::vector<int> columns;
  for (const int t : element.targets) {
    if (column_of_[static_cast<size_t>(t)] >= 0)
      columns.push_back(column_of_[static_cast<size_t>(t)]);
  }
  return columns;
}

MatrixXd SizeColumns(const MotionFrame& frame, const FeatureElement& element,
                     std::span<const int> targets) {
  const auto n = static_cast<Eigen::Index>(targets.size());
  const NominalSurface& s = element.surface;
  if (element.width) return MatrixXd::Ones(n, 1);
  const bool round = s.kind == SurfaceKind::kCylinder || s.kind == SurfaceKind::kSphere;
  if (!round && s.kind != SurfaceKind::kCone && s.kind != SurfaceKind::kTorus) {
    return MatrixXd(n, 0);
  }
  MatrixXd columns(n, s.kind == SurfaceKind::kTorus ? 2 : 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    const FeatureTarget& t =
        frame.feature().targets[static_cast<size_t>(targets[static_cast<size_t>(i)])];
    const Vector3d gradient = DistanceGradient(s, t.position_m, t.normal);
    const double side = gradient.dot(t.normal) < 0 ? -1 : 1;
    const Vector3d d = t.position_m - s.point_m;
    const Vector3d radial = (d - s.axis.dot(d) * s.axis).normalized();
    if (round) {
      columns(i, 0) = side;
    } else if (s.kind == SurfaceKind::kTorus) {
      columns.row(i) << side, side * gradient.dot(radial);
    } else {
      // A wider cone leaves its apex and raises the surface with the distance from it.
      columns(i, 0) = side * d.norm() / frame.scale_m();
    }
  }
  return columns;
}

MotionEstimate UnknownMotion(const MotionFrame& frame) {
  const auto used = static_cast<Eigen::Index>(frame.used().size());
  MotionEstimate motion;
  motion.estimator = MatrixXd::Zero(6, used);
  motion.sizes = MatrixXd(0, used);
  return motion;
}

absl::Status FixRemaining(const MotionFrame& frame, std::span<const FeatureElement> group,
                          bool with_sizes, MotionEstimate& motion) {
  const MatrixXd free = Complement(motion.fixed);
  const GroupDesign design = DesignOf(frame, group, with_sizes, true);
  const Sight sight = SightOf(design, free);
  const Sight nominal = SightOf(DesignOf(frame, group, with_sizes, false), free);
  const auto rows = static_cast<Eigen::Index>(design.columns.size());
  if (sight.rank < nominal.rank || rows < sight.rank + design.sizes.cols()) {
    return absl::FailedPreconditionError(absl::StrCat(
        "its ", rows, " targets that are known well enough do not determine the fit of ",
        nominal.rank + design.sizes.cols(), " parameters"));
  }
  // Residuals of the group after the fixed part of the motion, as functions of all used targets.
  const auto used = static_cast<Eigen::Index>(frame.used().size());
  MatrixXd left = -design.rigid * motion.estimator;
  for (Eigen::Index k = 0; k < rows; ++k) left(k, design.columns[static_cast<size_t>(k)]) += 1;
  if (sight.rank > 0) {
    const MatrixXd u = sight.svd.matrixU().leftCols(sight.rank);
    const MatrixXd v = free * sight.svd.matrixV().leftCols(sight.rank);
    const VectorXd inverse = sight.svd.singularValues().head(sight.rank).cwiseInverse();
    // Size columns are orthogonal to U, so that fitting them out first changes nothing.
    const MatrixXd found = inverse.asDiagonal() * (u.transpose() * left);
    motion.estimator += v * found;
    left -= design.rigid * (v * found);
    MatrixXd fixed(6, motion.fixed.cols() + sight.rank);
    fixed << motion.fixed, v;
    motion.fixed = std::move(fixed);
  }
  motion.sizes = design.sizes.cols() > 0 ? MatrixXd(sight.size_inverse * left) : MatrixXd(0, used);
  return absl::OkStatus();
}

}  // namespace sightline
