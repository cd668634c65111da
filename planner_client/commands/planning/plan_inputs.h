// SPDX-License-Identifier: Apache-2.0
// Inputs of `sightline plan` besides the inspection. Wrong ones are found before the scene is
// built, which takes seconds.
#pragma once

#include <optional>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/commands/planning/plan_options.h"
#include "planner_client/commands/planning/replanning/as_measured_session.h"
#include "planner_client/commands/starts/search_checkpoint.h"
#include "planning/strategy/planner.h"

namespace sightline {

// Scans of --keep and --resume become locked and starting scans of the request.
absl::Status ReadGivenScans(PlanOptions& options, PlannerRequest& request);

// Scans that were measured, if any.
absl::StatusOr<EarlierPlan> ReadMeasuredScans(PlanOptions& options, PlannerRequest& request);

// Checks the inputs of --optics.
absl::Status CheckOptics(const PlanOptions& options);

// Everything that the answers kept by --checkpoint depend on; unset without this option.
absl::StatusOr<std::optional<SearchQuestion>> QuestionOf(const PlanOptions& options);

}  // namespace sightline
