// SPDX-License-Identifier: Apache-2.0
// Options of `sightline plan`.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "core/inspection/inspection.h"
#include "planner_client/commands/planning/pareto_outputs.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/commands/planning/replanning/as_measured_session.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/commands/starts/plan_starts.h"
#include "planner_client/commands/worker_session.h"
#include "planning/strategy/planner.h"

namespace sightline {

struct PlanOptions {
  SessionOptions session;
  OutputOptions output;
  std::string strategy = "refined";
  std::string keep;
  std::string checkpoint;
  bool resume = false;
  AsMeasuredOptions measured;
  ParetoOptions pareto;
  StartsOptions starts;
  int64_t seed = 1;
  std::optional<double> goal;
  std::optional<int> max_scans;
  std::optional<double> max_time_s, goal_time_s;
  std::optional<int> max_setups, max_sensor_places, max_resting_faces;
  int64_t evaluations_per_scan = 5000;
  int64_t matrix_samples = 1500000;
  int64_t bound_evaluations = 100000;
  bool optics = false;
  int optics_rounds = 4;
  WorkerSessionOptions worker;
};

// `options` must outlive the application.
void AddPlanOptions(CLI::App& app, PlanOptions* options);

// INVALID_ARGUMENT if an option of planning is combined with one that picks a point of an existing
// front.
absl::Status CheckPickAlone(const CLI::App& app);

// Replaces the inspection's goal by the stated options.
void SetGoal(const PlanOptions& options, PlanningGoal& goal);

// Sets the fields of the request that only options determine.
void SetOptions(const PlanOptions& options, PlannerRequest& request);

}  // namespace sightline
