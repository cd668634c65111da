// SPDX-License-Identifier: Apache-2.0
// Coverage of a plan under errors of placement, as fields of the plan and as text.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"

namespace sightline {

// Sets placement and coverage.placement_p5 of the plan. Plans without placement errors, plans with
// measured scans and interrupted plans stay unchanged.
absl::Status AddPlacementCoverage(const PlanningSession& session, PlanDocument* document);

// A sentence; empty without placement_p5.
std::string SummarisePlacement(const v1::Plan& plan);

}  // namespace sightline
