// SPDX-License-Identifier: Apache-2.0
// Targets of regions of interest.
#pragma once

#include <Eigen/Core>

#include "core/targets/target_set.h"

namespace sightline {

// Whether a target lies in a region's box, also where the spacing of another region counts. Places
// are single precision: a micrometre beyond the box is in it.
inline bool LiesInRegion(const TargetSet& targets, size_t target, const TargetRegion& region) {
  const Eigen::Array3d p = targets.positions_m[target].cast<double>().array();
  constexpr double kRoundingM = 1e-6;
  return (p >= region.min_m.array() - kRoundingM).all() &&
         (p <= region.max_m.array() + kRoundingM).all();
}

}  // namespace sightline
