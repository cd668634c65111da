// SPDX-License-Identifier: Apache-2.0
// Geometry and optics planned together: scans for a detection of the line, the setting for these
// scans, the detection learned with that setting, and again until neither changes. The step that
// thesis 7.2 names as future work.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/commands/worker_session.h"
#include "planning/strategy/planner.h"

namespace sightline {

struct JointPlanOptions {
  SessionOptions session;
  std::string folder;  // of plan.json; holds the plan whose setting is to be chosen
  int max_rounds = 4;
  int64_t seed = 1;
  WorkerSessionOptions worker;
};

// Goes on from a plan whose plan.json is in the folder. `session`, `document`: of that plan;
// replaced by those of later rounds. `request`: what it was planned by. A plan for coverage, which
// no setting changes, gets its settings in one round. The images of a round are looked for at the
// f-numbers that cost at most 1.6 times the best in the round before. An interruption keeps the
// last plan and returns CANCELLED. Errors of the servers, and of an inspection that lacks
// what images need.
absl::StatusOr<v1::OpticsPlan> PlanWithOptics(const JointPlanOptions& options,
                                              const PlannerRequest& request,
                                              PlanningSession* session, PlanDocument* document);

}  // namespace sightline
