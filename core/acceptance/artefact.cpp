// SPDX-License-Identifier: Apache-2.0
#include "core/acceptance/artefact.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kRingTilt_rad = 50 * kDegree;
constexpr double kBarTilt_rad = 30 * kDegree;

// Between the directions to camera and laser.
Vector3d Bisector(const ScanGeometry& geometry) {
  return (geometry.camera.origin_m.normalized() + geometry.laser.origin_m.normalized())
      .normalized();
}

ArtefactSurface SphereAt(const Vector3d& centre_m, double radius_m, const Vector3d& towards) {
  ArtefactSurface s;
  s.nominal.kind = SurfaceKind::kSphere;
  s.nominal.point_m = centre_m;
  s.nominal.radius_m = radius_m;
  s.reference_m = centre_m + radius_m * towards;
  return s;
}

// Part of a vector across the unit vector `axis`.
Vector3d Across(const Vector3d& vector, const Vector3d& axis) {
  return vector - axis.dot(vector) * axis;
}

bool Contains(const ArtefactSurface& s, const Vector3d& point_m) {
  const Vector3d from_middle = point_m - s.nominal.point_m;
  switch (s.nominal.kind) {
    case SurfaceKind::kPlane:
      return std::abs(s.side_x.dot(from_middle)) <= s.half_side_m &&
             std::abs(s.side_y.dot(from_middle)) <= s.half_side_m;
    case SurfaceKind::kCylinder:
      return std::abs(s.nominal.axis.dot(from_middle)) <= s.half_length_m;
    default:
      return true;
  }
}

// The roots of |across + t step| = radius.
std::vector<double> RoundRoots(const Vector3d& across, const Vector3d& step, double radius_m) {
  const double a = step.squaredNorm(), half_b = across.dot(step);
  const double c = across.squaredNorm() - radius_m * radius_m;
  const double discriminant = half_b * half_b - a * c;
  if (!(discriminant >= 0) || !(a > 0)) return {};
  const double root = std::sqrt(discriminant);
  return {(-half_b - root) / a, (-half_b + root) / a};
}

}  // namespace

Vector3d AirNormal(const ArtefactSurface& s, const Vector3d& point_m) {
  const Vector3d outward = DistanceGradient(s.nominal, point_m, Vector3d::UnitZ());
  return s.hollow ? Vector3d(-outward) : outward;
}

std::vector<Vector3d> Crossings(const ArtefactSurface& s, const Vector3d& point_m,
                                const Vector3d& direction) {
  const Vector3d from_middle = point_m - s.nominal.point_m;
  std::vector<double> roots;
  switch (s.nominal.kind) {
    case SurfaceKind::kPlane:
      roots = {-s.nominal.axis.dot(from_middle) / s.nominal.axis.dot(direction)};
      break;
    case SurfaceKind::kCylinder:
      roots = RoundRoots(Across(from_middle, s.nominal.axis), Across(direction, s.nominal.axis),
                         s.nominal.radius_m);
      break;
    default:
      roots = RoundRoots(from_middle, direction, s.nominal.radius_m);
  }
  std::vector<Vector3d> points;
  for (const double t : roots) {
    const Vector3d p = point_m + t * direction;
    if (p.allFinite() && Contains(s, p)) points.push_back(p);
  }
  return points;
}

bool IsSeen(const ArtefactSurface& s, const Vector3d& point_m, const Vector3d& from_m,
            double most_incidence_rad) {
  const Vector3d to_sensor = (from_m - point_m).normalized();
  if (!(AirNormal(s, point_m).dot(to_sensor) >= std::cos(most_incidence_rad))) return false;
  if (!s.hollow) return true;
  // The line of sight meets the bore's wall once more; it must have left the bore before.
  const Vector3d across = Across(point_m - s.nominal.point_m, s.nominal.axis);
  const Vector3d step = Across(to_sensor, s.nominal.axis);
  const double t = -2 * across.dot(step) / step.squaredNorm();
  return !Contains(s, point_m + t * to_sensor);
}

std::vector<Vector3d> SamplePoints(const ArtefactSurface& s, int count) {
  std::vector<Vector3d> points;
  const Vector3d u =
      s.nominal.kind == SurfaceKind::kPlane ? s.side_x : s.nominal.axis.unitOrthogonal();
  const Vector3d v = s.nominal.axis.cross(u);
  const int side = std::max(2, static_cast<int>(std::ceil(std::sqrt(count))));
  for (int i = 0; i < side; ++i) {
    for (int j = 0; j < side; ++j) {
      const double a = -1 + 2.0 * i / (side - 1), b = -1 + 2.0 * j / (side - 1);
      const double turn = std::numbers::pi * a;
      const Vector3d round = std::cos(turn) * u + std::sin(turn) * v;
      const double r = s.nominal.radius_m;
      Vector3d from_middle;
      switch (s.nominal.kind) {
        case SurfaceKind::kPlane:
          from_middle = s.half_side_m * (a * s.side_x + b * s.side_y);
          break;
        case SurfaceKind::kCylinder:
          from_middle = r * round + b * s.half_length_m * s.nominal.axis;
          break;
        default:  // equal areas (Archimedes)
          from_middle = r * (std::sqrt(1 - b * b) * round + b * s.nominal.axis);
      }
      points.emplace_back(s.nominal.point_m + from_middle);
    }
  }
  return points;
}

Artefact MakeSphere(const ScanGeometry& geometry, double diameter_m) {
  const Vector3d towards = Bisector(geometry);
  const double radius_m = 0.5 * diameter_m;
  Artefact sphere{ArtefactKind::kSphere, "sphere", {}};
  sphere.surfaces.push_back(SphereAt(-0.5 * radius_m * towards, radius_m, towards));
  return sphere;
}

Artefact MakePlate(double side_m) {
  ArtefactSurface s;
  s.nominal.kind = SurfaceKind::kPlane;
  s.side_x = Vector3d::UnitX();
  s.side_y = Vector3d::UnitY();
  s.half_side_m = 0.5 * side_m;
  s.reference_m.setZero();
  return {ArtefactKind::kPlate, "flat plate", {s}};
}

Artefact MakeRing(const ScanGeometry& geometry, double diameter_m) {
  const Vector3d towards = Bisector(geometry);
  const Vector3d across = geometry.camera.x_axis.cross(towards).normalized();
  ArtefactSurface s;
  s.hollow = true;
  s.nominal.kind = SurfaceKind::kCylinder;
  s.nominal.axis = std::cos(kRingTilt_rad) * towards + std::sin(kRingTilt_rad) * across;
  s.nominal.radius_m = 0.5 * diameter_m;
  s.half_length_m = 0.125 * diameter_m;
  s.nominal.point_m = s.nominal.radius_m * Across(towards, s.nominal.axis).normalized();
  s.reference_m.setZero();
  return {ArtefactKind::kRing, "ring gauge", {s}};
}

Artefact MakeHolePattern(const ScanGeometry& geometry, double side_m, double bore_diameter_m) {
  const ArtefactSurface bore = MakeRing(geometry, bore_diameter_m).surfaces.front();
  const Vector3d u = Across(geometry.camera.x_axis, bore.nominal.axis).normalized();
  const Vector3d v = bore.nominal.axis.cross(u);
  Artefact pattern{ArtefactKind::kHolePattern, "hole pattern in two set-ups", {}};
  // Around the square, so that the bore after the next is the opposite one.
  for (const auto& [along_u, along_v] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    ArtefactSurface& moved = pattern.surfaces.emplace_back(bore);
    const Vector3d place_m = 0.5 * side_m * (along_u * u + along_v * v);
    moved.nominal.point_m = place_m;
    moved.reference_m = place_m - bore.nominal.point_m;
  }
  return pattern;
}

std::vector<Artefact> MakeBallBars(const ScanGeometry& geometry, double length_m,
                                   double diameter_m) {
  const Vector3d towards = Bisector(geometry);
  const Vector3d line = geometry.camera.x_axis;
  const double radius_m = 0.5 * diameter_m;
  const std::pair<const char*, Vector3d> directions[] = {
      {"along the line", line},
      {"along the stage", Vector3d::UnitX()},
      {"between line and stage", (line + Vector3d::UnitX()).normalized()},
      {"along the line, inclined",
       std::cos(kBarTilt_rad) * line + std::sin(kBarTilt_rad) * Vector3d::UnitZ()}};
  std::vector<Artefact> bars;
  for (const auto& [name, direction] : directions) {
    Artefact bar{ArtefactKind::kBallBar, std::string("ball bar ") + name, {}};
    for (const double side : {-0.5, 0.5}) {
      bar.surfaces.push_back(
          SphereAt(side * length_m * direction - 0.5 * radius_m * towards, radius_m, towards));
    }
    bars.push_back(std::move(bar));
  }
  return bars;
}

}  // namespace sightline
