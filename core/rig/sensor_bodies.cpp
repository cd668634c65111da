// SPDX-License-Identifier: Apache-2.0
#include "core/rig/sensor_bodies.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <variant>
#include <vector>

namespace sightline {
namespace {

// Both solids' faces and edges are spanned by their generators, so the normals of the faces of
// their Minkowski difference are products of two of all generators.
double OverlapOf(const Zonotope& a, const Zonotope& b) {
  std::vector<Eigen::Vector3d> generators = a.generators_m;
  generators.insert(generators.end(), b.generators_m.begin(), b.generators_m.end());
  const Eigen::Vector3d between = b.centre_m - a.centre_m;
  double least_m = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < generators.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      const Eigen::Vector3d normal = generators[i].cross(generators[j]);
      const double length = normal.norm();
      if (length <= 1e-9 * generators[i].norm() * generators[j].norm()) continue;  // parallel
      const double reach_m = a.HalfExtent(normal) + b.HalfExtent(normal);
      least_m = std::min(least_m, (reach_m - std::abs(between.dot(normal))) / length);
      if (least_m <= 0) return 0;
    }
  }
  return least_m;
}

// Bodies are often drawn as touching, and their poses are rounded.
constexpr double kContactM = 1e-6;

}  // namespace

Zonotope BodyAt(const Body& body, const SensorPose& pose) {
  Eigen::Matrix3d axes;
  axes << pose.x_axis, pose.y_axis, pose.z_axis;
  Zonotope solid;
  if (const auto* box = std::get_if<BoxBody>(&body)) {
    solid.centre_m = pose.origin_m + axes * box->centre_m;
    for (int k = 0; k < 3; ++k) solid.generators_m.push_back(0.5 * box->size_m[k] * axes.col(k));
    return solid;
  }
  const auto& cylinder = std::get<CylinderBody>(body);
  solid.centre_m = pose.origin_m + axes * cylinder.centre_m;
  solid.generators_m.push_back(0.5 * cylinder.length_m * axes.col(2));
  // Four generators of equal length g, 45 degrees apart, span a regular octagon with an inner
  // radius of g (1 + sqrt(2)).
  const double g = cylinder.radius_m / (1 + std::numbers::sqrt2);
  for (int k = 0; k < 4; ++k) {
    const double angle = std::numbers::pi / 4 * k;
    solid.generators_m.push_back(g *
                                 (std::cos(angle) * axes.col(0) + std::sin(angle) * axes.col(1)));
  }
  return solid;
}

Body WithMargin(const Body& body, double margin_m) {
  if (const auto* box = std::get_if<BoxBody>(&body)) {
    return BoxBody{box->centre_m, box->size_m + Eigen::Vector3d::Constant(2 * margin_m)};
  }
  const auto& cylinder = std::get<CylinderBody>(body);
  return CylinderBody{cylinder.centre_m, cylinder.radius_m + margin_m,
                      cylinder.length_m + 2 * margin_m};
}

double SensorBodyOverlap(const Rig& rig, const ScanGeometry& geometry) {
  double deepest_m = 0;
  for (const Body& camera : rig.camera_bodies) {
    const Zonotope a = BodyAt(camera, geometry.camera);
    for (const Body& laser : rig.laser_bodies) {
      deepest_m = std::max(deepest_m, OverlapOf(a, BodyAt(laser, geometry.laser)));
    }
  }
  return deepest_m;
}

bool SensorBodiesCollide(const Rig& rig, const ScanGeometry& geometry) {
  return SensorBodyOverlap(rig, geometry) > kContactM;
}

}  // namespace sightline
