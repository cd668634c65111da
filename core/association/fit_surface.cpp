// SPDX-License-Identifier: Apache-2.0
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <unsupported/Eigen/NonLinearOptimization>
#include <unsupported/Eigen/NumericalDiff>
#include <utility>
#include <vector>

#include "core/association/nominal_surface.h"
#include "core/association/surface_parameters.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// Points and their normals, in units in which all numbers are of order 1.
struct Cloud : NormalisedCloud {
  std::vector<Vector3d> normals;

  Cloud(std::span<const Vector3d> points_m, std::span<const Vector3d> unit_normals)
      : NormalisedCloud(points_m), normals(unit_normals.begin(), unit_normals.end()) {}
};

Eigen::Matrix3d Moments(const std::vector<Vector3d>& vectors, const Vector3d& about) {
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Vector3d& v : vectors) moments += (v - about) * (v - about).transpose();
  return moments;
}

Vector3d Mean(const std::vector<Vector3d>& vectors) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& v : vectors) sum += v;
  return sum / static_cast<double>(vectors.size());
}

Vector3d SmallestAxis(const Eigen::Matrix3d& moments) {
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvectors().col(0);
}

// Least squares of the smallest norm.
VectorXd Solve(const MatrixXd& a, const VectorXd& b) {
  return a.bdcSvd(Eigen::ComputeThinU | Eigen::ComputeThinV).solve(b);
}

NominalSurface StartOfPlane(const Cloud& cloud) {
  NominalSurface s;
  s.kind = SurfaceKind::kPlane;
  s.axis = SmallestAxis(Moments(cloud.points, Vector3d::Zero()));
  if (s.axis.dot(Mean(cloud.normals)) < 0) s.axis = -s.axis;
  return s;
}

// p - r n lies on the axis or centre: linear in the unknown place and r.
NominalSurface StartOfRound(SurfaceKind kind, const Cloud& cloud) {
  NominalSurface s;
  s.kind = kind;
  std::vector<Vector3d> along = {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
  if (kind == SurfaceKind::kCylinder) {
    s.axis = SmallestAxis(Moments(cloud.normals, Vector3d::Zero()));
    const Vector3d across = s.axis.unitOrthogonal();
    along = {across, s.axis.cross(across)};
  }
  const auto places = static_cast<Eigen::Index>(along.size());
  const auto n = static_cast<Eigen::Index>(cloud.points.size());
  MatrixXd a = MatrixXd::Zero(places * n, places + 1);
  VectorXd b(places * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < places; ++k) {
      a(places * i + k, k) = 1;
      a(places * i + k, places) = along[k].dot(cloud.normals[i]);
      b(places * i + k) = along[k].dot(cloud.points[i]);
    }
  }
  const VectorXd x = Solve(a, b);
  for (Eigen::Index k = 0; k < places; ++k) s.point_m += x(k) * along[k];
  s.radius_m = std::abs(x(places));
  return s;
}

// Normals of a cone make one angle with its axis; its tangent planes meet at the apex.
NominalSurface StartOfCone(const Cloud& cloud) {
  NominalSurface s;
  s.kind = SurfaceKind::kCone;
  s.axis = SmallestAxis(Moments(cloud.normals, Mean(cloud.normals)));
  const auto n = static_cast<Eigen::Index>(cloud.points.size());
  MatrixXd a(n, 3);
  VectorXd b(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    a.row(i) = cloud.normals[i].transpose();
    b(i) = cloud.normals[i].dot(cloud.points[i]);
  }
  s.point_m = Solve(a, b);
  if (s.axis.dot(Mean(cloud.points) - s.point_m) < 0) s.axis = -s.axis;
  double sine = 0;
  for (const Vector3d& normal : cloud.normals) sine += std::abs(normal.dot(s.axis));
  s.half_angle_rad = std::asin(std::clamp(sine / static_cast<double>(n), 1e-6, 1 - 1e-9));
  return s;
}

// Every normal line meets the axis: a linear equation in the axis's line coordinates (Pottmann and
// Wallner, Computational Line Geometry, 2001, 4.1). In the half plane of the axis p - r n is then
// the centre of the tube.
NominalSurface StartOfTorus(const Cloud& cloud) {
  NominalSurface s;
  s.kind = SurfaceKind::kTorus;
  const auto n = static_cast<Eigen::Index>(cloud.points.size());
  MatrixXd lines(n, 6);
  for (Eigen::Index i = 0; i < n; ++i) {
    lines.row(i) << cloud.points[i].cross(cloud.normals[i]).transpose(),
        cloud.normals[i].transpose();
  }
  const Eigen::BDCSVD<MatrixXd> svd(lines, Eigen::ComputeThinV);
  const VectorXd line = svd.matrixV().col(5);
  const Vector3d direction = line.head<3>(), moment = line.tail<3>();
  if (!(direction.norm() > 1e-6)) return s;
  s.axis = direction.normalized();
  s.point_m = direction.cross(moment) / direction.squaredNorm();
  MatrixXd a = MatrixXd::Zero(2 * n, 3);
  VectorXd b(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Vector3d d = cloud.points[i] - s.point_m;
    const double along = s.axis.dot(d);
    const Vector3d radial = (d - along * s.axis).normalized();
    a.row(2 * i) << 1, 0, radial.dot(cloud.normals[i]);
    a.row(2 * i + 1) << 0, 1, s.axis.dot(cloud.normals[i]);
    b(2 * i) = radial.dot(d);
    b(2 * i + 1) = along;
  }
  const VectorXd x = Solve(a, b);
  s.radius_m = std::abs(x(0));
  s.point_m += x(1) * s.axis;
  s.tube_radius_m = std::abs(x(2));
  return s;
}

}  // namespace

std::optional<NominalSurface> FitSurface(SurfaceKind kind, std::span<const Vector3d> points_m,
                                         std::span<const Vector3d> normals) {
  if (kind == SurfaceKind::kFreeform || points_m.size() < 3) return std::nullopt;
  const Cloud cloud(points_m, normals);
  const NominalSurface start =
      kind == SurfaceKind::kPlane ? StartOfPlane(cloud)
      : kind == SurfaceKind::kCone
          ? StartOfCone(cloud)
          : (kind == SurfaceKind::kTorus ? StartOfTorus(cloud) : StartOfRound(kind, cloud));
  if (!start.point_m.allFinite() || !std::isfinite(start.radius_m + start.tube_radius_m)) {
    return std::nullopt;
  }
  const SurfaceParameters unknowns(start);
  VectorXd x = VectorXd::Zero(static_cast<Eigen::Index>(unknowns.used.size()));
  if (cloud.points.size() < unknowns.used.size()) return std::nullopt;
  const SurfaceDistances distances{unknowns, cloud.points};
  Eigen::NumericalDiff<SurfaceDistances, Eigen::Central> differentiated(distances);
  Eigen::LevenbergMarquardt<decltype(differentiated)> solver(differentiated);
  solver.parameters.maxfev = 400;
  solver.parameters.ftol = solver.parameters.xtol = 1e-14;
  solver.minimize(x);
  if (!x.allFinite()) return std::nullopt;
  const NominalSurface s = cloud.InMetres(unknowns.At(x));
  const double half_turn = std::numbers::pi / 2;
  if (kind == SurfaceKind::kCone && !(s.half_angle_rad > 0.01 && s.half_angle_rad < half_turn)) {
    return std::nullopt;
  }
  if (s.radius_m < 0 || s.tube_radius_m < 0) return std::nullopt;
  return s;
}

NominalSurface RecogniseSurface(std::span<const Vector3d> points_m,
                                std::span<const Vector3d> normals, const Recognition& limits) {
  const double least_cosine = std::cos(limits.most_normal_angle_rad);
  for (const SurfaceKind kind : {SurfaceKind::kPlane, SurfaceKind::kCylinder, SurfaceKind::kCone,
                                 SurfaceKind::kSphere, SurfaceKind::kTorus}) {
    NominalSurface any;
    any.kind = kind;
    // A curved surface passes through any few points: one more than it has parameters decides.
    if (kind != SurfaceKind::kPlane && points_m.size() <= SurfaceParameters(any).used.size())
      continue;
    const auto surface = FitSurface(kind, points_m, normals);
    if (!surface) continue;
    bool all_near = true;
    for (size_t i = 0; i < points_m.size() && all_near; ++i) {
      const Vector3d gradient = DistanceGradient(*surface, points_m[i], normals[i]);
      all_near = std::abs(SignedDistance(*surface, points_m[i])) <= limits.most_distance_m &&
                 std::abs(gradient.dot(normals[i])) >= least_cosine;
    }
    if (all_near) return *surface;
  }
  return {};
}

}  // namespace sightline
