// Which targets can be measured at all (thesis section 6.1).
#pragma once

#include "core/targets/target_set.h"
#include "coverage_server/visibility/visibility_field.h"

namespace sightline {

// A target is measurable if two unoccluded directions min_angle to max_angle apart reach it.
// Candidates are the field's cells, so cones narrower than a cell (about 3 degrees at 4096) are
// decided to that accuracy. `begin`, `end`: range of targets whose bits are written.
void MarkMeasurable(const TargetSet& targets, const VisibilityField& field, double min_angle_rad,
                    double max_angle_rad, size_t begin, size_t end, TargetBits& measurable);

}  // namespace sightline
