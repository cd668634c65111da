// SPDX-License-Identifier: Apache-2.0
// Reads scans from a plan.json that a person edited or an earlier run wrote.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/rig/measurement.h"
#include "planning/plan_file/part_of_plan.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Same limit as goal.max_scans.
inline constexpr int kMostPlanScans = 1000;

struct PlanFileScans {
  std::vector<Measurement> all;
  std::vector<bool> locked;
  v1::Plan plan;
};

// Reads the scans of a plan file, at most kMostPlanScans, and adds the plan to `given`, which the
// caller compares with the part of its inspection. INVALID_ARGUMENT names the file, scan and field.
absl::StatusOr<PlanFileScans> ReadPlanScans(const std::string& path, GivenPlans* given);

}  // namespace sightline
