// SPDX-License-Identifier: Apache-2.0
// Finds the targets that can be measured in free space (thesis section 6.1).
#pragma once

#include <atomic>
#include <optional>
#include <vector>

#include "core/targets/target_set.h"
#include "coverage_server/collision/collision.h"
#include "coverage_server/detectability/light_limit.h"
#include "coverage_server/detectability/light_map.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {

// Limits on the directions from a target to camera and laser.
struct DirectionLimits {
  double min_angle_rad, max_angle_rad;  // between the two directions
  double min_cos_incidence = 0;         // least cosine between each direction and the normal
  // With both set: a permitted exposure must show the line from the two directions, at some camera
  // distance of the material's table; either direction may be the camera's.
  const LightLimit* light = nullptr;
  const LightMap* light_map = nullptr;
  std::optional<double> laser_distance_m = std::nullopt;  // unset: that of the camera

  bool operator==(const DirectionLimits&) const = default;
};

// A target is measurable if two unoccluded directions within `limits` reach it. Candidates are the
// directions of the field's map; if these have no such pair, those of a map twice as fine (2
// degrees apart by default; the thesis draws 2^16 random pairs). The field preselects directions,
// and segment tests against `occluders` (those in part coordinates) decide. `begin`, `end`: range
// of targets whose bits are written. Stops early when *cancelled; may be null.
void MarkMeasurable(const TargetSet& targets, const VisibilityField& field,
                    const std::vector<Occluder>& occluders, const DirectionLimits& limits,
                    size_t begin, size_t end, TargetBits& measurable,
                    const std::atomic<bool>* cancelled = nullptr);

}  // namespace sightline
