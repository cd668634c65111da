// SPDX-License-Identifier: Apache-2.0
#include "planner_client/scan_quality/scan_quality.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

// Between unit vectors. By both products: the cosine alone loses small angles to rounding.
double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

double Quantile(const std::vector<double>& sorted, double fraction) {
  const double place = fraction * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return std::lerp(sorted[below], sorted[above], place - static_cast<double>(below));
}

}  // namespace

PointQuality QualityOfPoint(const Camera& camera, const ScanGeometry& geometry,
                            const Eigen::Vector3d& point_m, const Eigen::Vector3d& normal) {
  const Eigen::Vector3d ray = point_m - geometry.camera.origin_m;
  const Eigen::Vector3d sight = ray / ray.norm();
  const Eigen::Vector3d to_laser = (geometry.laser.origin_m - point_m).normalized();
  const double across = sight.dot(geometry.sheet_normal);
  PointQuality quality;
  quality.pixel_footprint_m = ray.dot(geometry.camera.z_axis) / camera.FocalLengthPx();
  quality.triangulation_angle_rad =
      std::atan2(std::abs(across), sight.cross(geometry.sheet_normal).norm());
  quality.depth_per_pixel_m = quality.pixel_footprint_m / std::abs(across);
  quality.camera_incidence_rad = AngleBetween(normal, -sight);
  quality.laser_incidence_rad = AngleBetween(normal, to_laser);
  return quality;
}

Spread SpreadOf(std::vector<double> values) {
  assert(!values.empty());
  std::sort(values.begin(), values.end());
  return {Quantile(values, 0.025), Quantile(values, 0.5), Quantile(values, 0.975)};
}

std::optional<ScanQuality> QualityOfScan(const Rig& rig, const Measurement& measurement,
                                         const Eigen::Vector3d& part_centre_m,
                                         std::span<const MeasuredPoint> points) {
  if (points.empty()) return std::nullopt;
  const ScanGeometry geometry = MakeScanGeometry(rig, measurement);
  constexpr double PointQuality::*kQuantities[] = {
      &PointQuality::pixel_footprint_m, &PointQuality::depth_per_pixel_m,
      &PointQuality::triangulation_angle_rad, &PointQuality::camera_incidence_rad,
      &PointQuality::laser_incidence_rad};
  constexpr Spread ScanQuality::*kSpreads[] = {
      &ScanQuality::pixel_footprint_m, &ScanQuality::depth_per_pixel_m,
      &ScanQuality::triangulation_angle_rad, &ScanQuality::camera_incidence_rad,
      &ScanQuality::laser_incidence_rad};
  std::vector<double> values[std::size(kQuantities)];
  for (std::vector<double>& of_quantity : values) of_quantity.reserve(points.size());
  for (const MeasuredPoint& point : points) {
    const double stage_m = point.frame * rig.scan_step_m;
    const PointQuality quality = QualityOfPoint(
        rig.camera, geometry,
        PartToWorld(geometry, part_centre_m, point.position_m.cast<double>(), stage_m),
        geometry.part_rotation * point.normal.cast<double>());
    for (size_t q = 0; q < std::size(kQuantities); ++q) {
      values[q].push_back(quality.*kQuantities[q]);
    }
  }
  ScanQuality spreads;
  for (size_t q = 0; q < std::size(kQuantities); ++q) {
    spreads.*kSpreads[q] = SpreadOf(std::move(values[q]));
  }
  return spreads;
}

std::vector<float> BestDepthPerPixel(const Rig& rig, std::span<const Measurement> measurements,
                                     std::span<const TargetBits> covered,
                                     const Eigen::Vector3d& part_centre_m,
                                     const TargetSet& targets) {
  assert(measurements.size() == covered.size());
  constexpr float kNone = std::numeric_limits<float>::infinity();
  std::vector<float> best_m(targets.size(), kNone);
  for (size_t s = 0; s < measurements.size(); ++s) {
    const ScanGeometry geometry = MakeScanGeometry(rig, measurements[s]);
    for (size_t t = 0; t < targets.size(); ++t) {
      if (!covered[s].Test(t)) continue;
      Eigen::Vector3d point_m =
          PartToWorld(geometry, part_centre_m, targets.positions_m[t].cast<double>(), 0);
      point_m.x() += geometry.LitStagePosition(point_m);
      const PointQuality quality =
          QualityOfPoint(rig.camera, geometry, point_m,
                         geometry.part_rotation * targets.normals[t].cast<double>());
      best_m[t] = std::min(best_m[t], static_cast<float>(quality.depth_per_pixel_m));
    }
  }
  for (float& depth_m : best_m) {
    if (depth_m == kNone) depth_m = 0;
  }
  return best_m;
}

std::vector<double> Overlaps(std::span<const TargetBits> covered) {
  if (covered.empty()) return {};
  // Covered by one scan or more, and by two or more.
  TargetBits once(covered[0].size()), twice = once;
  for (const TargetBits& scan : covered) {
    TargetBits again = scan;
    again &= once;
    twice |= again;
    once |= scan;
  }
  std::vector<double> overlaps;
  for (const TargetBits& scan : covered) {
    TargetBits shared = scan;
    shared &= twice;
    const auto count = static_cast<double>(scan.Count());
    overlaps.push_back(count > 0 ? static_cast<double>(shared.Count()) / count : 0);
  }
  return overlaps;
}

}  // namespace sightline
