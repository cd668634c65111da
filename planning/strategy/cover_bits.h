// SPDX-License-Identifier: Apache-2.0
// Counting kernels over target bit sets, compiled for CPUs with and without popcnt.
#pragma once

#include <cstdint>

#include "core/targets/target_set.h"

namespace sightline {

// Number of targets in both sets, which have equal sizes.
int64_t CountInBoth(const TargetBits& a, const TargetBits& b);

// Number of targets in `a` but not in `b` (equal sizes). Faster than a.CountNotIn(b).
int64_t CountOnlyIn(const TargetBits& a, const TargetBits& b);

}  // namespace sightline
