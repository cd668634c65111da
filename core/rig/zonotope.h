// SPDX-License-Identifier: Apache-2.0
// Convex solids that sum up segments: boxes, prisms, and the volumes that they sweep in a move.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

namespace sightline {

// Convex, centrally symmetric solid: centre + sum of t_i * generator_i, t_i in [-1, 1]. A box has
// three generators; swept along a segment it has four.
struct Zonotope {
  Eigen::Vector3d centre_m;
  std::vector<Eigen::Vector3d> generators_m;

  // Half extent along a direction (support function of the centred solid).
  double HalfExtent(const Eigen::Vector3d& direction) const {
    double extent = 0;
    for (const Eigen::Vector3d& g : generators_m) extent += std::abs(g.dot(direction));
    return extent;
  }
};

}  // namespace sightline
