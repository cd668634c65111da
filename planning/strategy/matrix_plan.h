// SPDX-License-Identifier: Apache-2.0
// Planning with the measurability matrix (thesis section 2.2.1).
#pragma once

#include "planning/strategy/plan_run.h"

namespace sightline {

// Evaluates request().matrix_samples uniformly random scans in batches, keeps their coverage in
// memory and chooses from them greedily.
absl::StatusOr<PlannerResult> PlanWithMatrix(PlanRun& run);

}  // namespace sightline
