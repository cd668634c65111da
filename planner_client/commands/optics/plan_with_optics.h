// SPDX-License-Identifier: Apache-2.0
// Plans geometry and optics together. Each round plans scans for a model of line detection, chooses
// a setting for these scans, and learns the detection with that setting, until neither changes.
// Thesis 7.2 names this step as future work.
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
  std::string folder;  // folder of the plan.json whose setting is chosen
  int max_rounds = 4;
  int64_t seed = 1;
  WorkerSessionOptions worker;
};

// Continues from a plan whose plan.json is in the folder. `session` and `document` belong to
// that plan; later rounds replace them. `request`: input of that plan. A plan for coverage
// does not depend on settings, so one round suffices. Each round examines only f-numbers that
// cost at most 1.6 times the best of the previous round. An interruption keeps the last plan
// and returns CANCELLED. Errors of the servers, and of an inspection that lacks inputs of
// images.
absl::StatusOr<v1::OpticsPlan> PlanWithOptics(const JointPlanOptions& options,
                                              const PlannerRequest& request,
                                              PlanningSession* session, PlanDocument* document);

}  // namespace sightline
