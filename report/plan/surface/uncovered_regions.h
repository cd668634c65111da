// SPDX-License-Identifier: Apache-2.0
// Connected regions of the surface that a plan leaves unmeasured.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "core/targets/target_set.h"

namespace sightline {

// One region, part coordinates, metres.
struct UncoveredRegion {
  std::vector<uint32_t> targets;  // ascending
  double area_share = 0;          // of all targets' area, in [0, 1]
  Eigen::Vector3d centroid_m;     // of the region's targets
  Eigen::AlignedBox3d bounds_m;
  Eigen::Vector3d mean_normal;  // not normalised: short if the region faces many directions
};

// Relative surface area per target: the square of its sampling
// spacing.
std::vector<double> TargetAreaWeights(const TargetSet& targets, const TargetSampling& sampling);

// Clusters the targets in `selected` (one bit per target). Two targets are connected if their
// distance is at most twice the larger of their spacings and their normals differ by less than 120
// degrees. Thus the two sides of a thin wall stay apart, but a region can continue around an edge.
// Sorted by descending area, then by the first target.
std::vector<UncoveredRegion> FindUncoveredRegions(const TargetSet& targets,
                                                  const TargetSampling& sampling,
                                                  const TargetBits& selected);

// Describes the position of a region in the part's bounding box and its orientation, e.g. "at the
// y- side, 23 mm below the top, facing y-". z is taken as up.
std::string DescribePlace(const UncoveredRegion& region, const Eigen::AlignedBox3d& part_bounds_m);

}  // namespace sightline
