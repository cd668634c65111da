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

// INVALID_ARGUMENT if `front` is used with a strategy without fronts or with another planning mode
// (`other`: name of the option, or empty), if `pick` is used with either, or for several picks.
absl::Status CheckParetoOptions(const ParetoOptions& options, const std::string& strategy,
                                const std::string& other);

// Plans the front, writes pareto.json into the output folder and stores the front in `output` for
// the report. Returns the plan of the chosen point, PointForGoal. Errors of MakeParetoFront and of
// writing.
absl::StatusOr<PlannerResult> PlanFront(const PlanningSession& session,
                                        const PlannerRequest& request, ProgressLine& progress,
                                        OutputOptions* output);

// Writes plan, report and front for a point of the folder's pareto.json. Its numbers are evaluated
// exactly again and must agree. Returns the exit code of the command.
int RunPick(const SessionOptions& session, const ParetoPick& pick, OutputOptions output);

}  // namespace sightline
