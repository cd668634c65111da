// SPDX-License-Identifier: Apache-2.0
// `sightline plan --pareto` and `--pick`: the front of a task, and the plan of one of its points.
#pragma once

#include <CLI/CLI.hpp>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planning/pareto/pareto_json.h"
#include "planning/strategy/planner.h"

namespace sightline {

struct ParetoOptions {
  bool front = false;
  ParetoPick pick;

  bool Picks() const { return pick.number || pick.scans || pick.seconds; }
};

void AddParetoOptions(CLI::App& app, ParetoOptions* options);

// INVALID_ARGUMENT: `front` with a strategy that makes none or with another way of planning
// (`other`: the option's name, empty: none), `pick` with either, or more than one pick.
absl::Status CheckParetoOptions(const ParetoOptions& options, const std::string& strategy,
                                const std::string& other);

// Plans the front and writes pareto.json into the output folder; the front is put
// into `output`, for the report. The result is the plan of the chosen point, PointForGoal. Errors:
// those of MakeParetoFront, and of writing.
absl::StatusOr<PlannerResult> PlanFront(const PlanningSession& session,
                                        const PlannerRequest& request, ProgressLine& progress,
                                        OutputOptions* output);

// Writes plan, report and front of a point of the folder's pareto.json, whose numbers are evaluated
// exactly again and must be the same. Exit code of the command.
int RunPick(const SessionOptions& session, const ParetoPick& pick, OutputOptions output);

}  // namespace sightline
