// SPDX-License-Identifier: Apache-2.0
// Which targets can be measured at all (thesis section 6.1).
#pragma once

#include <atomic>
#include <vector>

#include "core/targets/target_set.h"
#include "coverage_server/scan/collision.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {

// A target is measurable if two unoccluded directions min_angle to max_angle apart reach it.
// Directions are those of the field's map, and where they find no pair of a map twice as fine (2
// degrees apart by default; the thesis draws 2^16 random pairs); the field says which are worth
// asking and segments through `occluders` (those in part coordinates) decide. `begin`, `end`: range
// of targets whose bits are written. Stops early when *cancelled; may be null.
void MarkMeasurable(const TargetSet& targets, const VisibilityField& field,
                    const std::vector<Occluder>& occluders, double min_angle_rad,
                    double max_angle_rad, size_t begin, size_t end, TargetBits& measurable,
                    const std::atomic<bool>* cancelled = nullptr);

}  // namespace sightline
