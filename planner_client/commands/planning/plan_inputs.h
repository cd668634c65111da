// SPDX-License-Identifier: Apache-2.0
// Inputs of `sightline plan` in addition to the inspection. They are checked before the scene is
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

// Reads the scans of --keep and --resume as locked and starting scans of the request.
absl::Status ReadGivenScans(PlanOptions& options, PlannerRequest& request);

// Reads the measured scans, if any.
absl::StatusOr<EarlierPlan> ReadMeasuredScans(PlanOptions& options, PlannerRequest& request);

// Checks the inputs of --optics.
absl::Status CheckOptics(const PlanOptions& options);

// Everything that the answers kept by --checkpoint depend on; nothing without that option.
absl::StatusOr<std::optional<SearchQuestion>> QuestionOf(const PlanOptions& options);

}  // namespace sightline
