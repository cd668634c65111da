// SPDX-License-Identifier: Apache-2.0
// Allowed ranges of numbers about targets and goals, for inspections and the options that make
// them.
#pragma once

#include "core/field_limits/field_checks.h"

namespace sightline {

inline constexpr Limits kTargetSpacing{1e-4, 1, " m"};
inline constexpr Limits kCoverageGoal{0, 1, "", true};
// Full width of a tolerance zone.
inline constexpr Limits kZoneWidth{0, 1, " m", true};

}  // namespace sightline
