// SPDX-License-Identifier: Apache-2.0
// How an engineer sets up a plan's scans: what the part lies on, and what is unusual about a scan.
#pragma once

#include <vector>

#include "planner_client/commands/planning/planning_session.h"
#include "planner_client/strategy/planner.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Fills in resting_faces, and resting_face and table_height_m of the scans, of parts that rest.
void AddSetups(const PlanningSession& session, v1::Plan* plan);

// Fills in remarks of the scans: outside the inspection's domain, not feasible, of no use. `given`:
// the whole plan was given, not only its locked scans.
void AddRemarks(const PlanningSession& session, const std::vector<ChosenScan>& scans, bool given,
                v1::Plan* plan);

}  // namespace sightline
