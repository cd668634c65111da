// SPDX-License-Identifier: Apache-2.0
#include "core/association/minimum_zone.h"

#include <cmath>
#include <unsupported/Eigen/NumericalDiff>

#include "core/association/chebyshev_fit.h"
#include "core/association/surface_parameters.h"

namespace sightline {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kMostZoneSteps = 60;
constexpr int kMostHalvings = 30;
// Half widths below this fraction of the cloud's extent are rounding of coordinates.
constexpr double kCoordinateRounding = 1e-13;
// Gaps relative to the half width. Fits of a nearly cylindrical cone or of a short arc may end
// between the two values, because single parameters are then ill determined.
constexpr double kConvergedGap = 1e-9, kMostGap = 1e-5;

VectorXd ZoneDistances(const NominalSurface& s, const std::vector<Vector3d>& points) {
  VectorXd distances(static_cast<Eigen::Index>(points.size()));
  for (size_t i = 0; i < points.size(); ++i) {
    distances[static_cast<Eigen::Index>(i)] = SignedDistance(s, points[i]);
  }
  return distances;
}

// Tilts turn the surface about its point, which should lie next to the points.
void MovePointAlongAxis(NominalSurface& s) {
  if (s.kind == SurfaceKind::kCylinder) s.point_m -= s.axis.dot(s.point_m) * s.axis;
  if (s.kind == SurfaceKind::kPlane) s.point_m = s.axis.dot(s.point_m) * s.axis;
}

// Coefficients that reduce the largest residual, none of them much beyond `most`. Additional rows
// with every coefficient times deviation / most make longer coefficients count as residuals (the
// trust region of Madsen, Journal of the Institute of Mathematics and its Applications 16 (1975)
// 321-328).
std::optional<VectorXd> StepWithin(const MatrixXd& jacobian, const VectorXd& distances, double most,
                                   double deviation) {
  const Eigen::Index n = jacobian.rows(), columns = jacobian.cols();
  MatrixXd rows(n + columns, columns);
  rows << jacobian, deviation / most * MatrixXd::Identity(columns, columns);
  VectorXd values = VectorXd::Zero(n + columns);
  values.head(n) = distances;
  const auto fit = FitChebyshev(rows, values);
  if (!fit) return std::nullopt;
  return fit->coefficients;
}

}  // namespace

std::optional<MinimumZone> FitMinimumZone(SurfaceKind kind, std::span<const Vector3d> points_m,
                                          std::span<const Vector3d> normals) {
  const auto least_squares = FitSurface(kind, points_m, normals);
  if (!least_squares) return std::nullopt;
  const NormalisedCloud cloud(points_m);
  NominalSurface surface = cloud.Normalised(*least_squares);
  VectorXd distances = ZoneDistances(surface, cloud.points);
  double half_width = distances.cwiseAbs().maxCoeff();
  std::optional<ChebyshevFit> linear;
  for (int step = 0; step < kMostZoneSteps; ++step) {
    MovePointAlongAxis(surface);
    const SurfaceParameters parameters(surface);
    const auto count = static_cast<Eigen::Index>(parameters.used.size());
    MatrixXd jacobian(distances.size(), count);
    const Eigen::NumericalDiff<SurfaceDistances, Eigen::Central> differentiated(
        SurfaceDistances{parameters, cloud.points});
    differentiated.df(VectorXd::Zero(count), jacobian);
    linear = FitChebyshev(jacobian, distances);
    if (!linear) return std::nullopt;
    if (half_width - linear->deviation <= kConvergedGap * half_width + kCoordinateRounding) break;
    bool narrower = false;
    double most = linear->coefficients.cwiseAbs().maxCoeff();
    VectorXd change = -linear->coefficients;
    for (int halving = 0; halving < kMostHalvings && !narrower; ++halving) {
      if (halving > 0) {
        const auto shorter = StepWithin(jacobian, distances, most *= 0.5, half_width);
        if (!shorter) break;
        change = -*shorter;
      }
      const NominalSurface moved = parameters.At(change);
      const VectorXd there = ZoneDistances(moved, cloud.points);
      narrower = there.cwiseAbs().maxCoeff() < half_width;
      if (!narrower) continue;
      surface = moved;
      distances = there;
      half_width = there.cwiseAbs().maxCoeff();
    }
    if (!narrower) break;
  }
  if (!linear) return std::nullopt;
  const double gap = half_width - linear->lower_bound;
  if (!(gap <= kMostGap * half_width + kCoordinateRounding)) return std::nullopt;
  MinimumZone zone;
  zone.surface = cloud.InMetres(surface);
  zone.width_m = cloud.scale_m * (distances.maxCoeff() - distances.minCoeff());
  zone.gap_m = 2 * cloud.scale_m * std::max(0.0, gap);
  for (const ActiveRow& row : linear->active) zone.active.push_back({row.row, 2 * row.weight});
  return zone;
}

}  // namespace sightline
