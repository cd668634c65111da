// SPDX-License-Identifier: Apache-2.0
// Reasons why a plan leaves targets uncovered.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"

namespace sightline {

// Asks the coverage server about every target that no scan of the plan covers, and fills in
// `document->reasons`, PlanCoverage.uncovered and PlanCoverage.regions. Errors of the server are
// passed on.
absl::Status ExplainUncovered(const PlanningSession& session, PlanDocument* document);

// A line for the terminal; empty if all is covered.
std::string SummariseUncovered(const v1::PlanCoverage& coverage);

}  // namespace sightline
