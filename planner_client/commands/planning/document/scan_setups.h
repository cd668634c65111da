// SPDX-License-Identifier: Apache-2.0
// Instructions for setting up a plan's scans: the part's support, and remarks on unusual scans.
#pragma once

#include <vector>

#include "planner_client/commands/planning/session/planning_session.h"
#include "planning/strategy/planner.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Fills in sensor_places and setups, and of parts that rest resting_faces, excluded_faces, and
// resting_face and table_height_m of the scans. Scans are in their order and have their times.
void AddSetups(const PlanningSession& session, v1::Plan* plan);

// Adds remarks to scans that are outside the inspection's domain, infeasible or without effect.
// `given`: the whole plan was given, not only its locked scans.
void AddRemarks(const PlanningSession& session, const std::vector<ChosenScan>& scans, bool given,
                v1::Plan* plan);

}  // namespace sightline
