// SPDX-License-Identifier: Apache-2.0
// One run of `sightline plan` on an open session: searches, the resulting plan, and its
// files.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/plan_options.h"
#include "planner_client/commands/planning/replanning/as_measured_session.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/commands/shard.h"
#include "planner_client/commands/starts/search_checkpoint.h"
#include "planning/multi_start/start_result.h"
#include "planning/strategy/bounded_plan.h"

namespace sightline {

class PlanningRun {
 public:
  // `part`: the starts that this process runs. `question`: set if answers are kept. `start`: time
  // at which the command began.
  PlanningRun(PlanOptions& options, PlannerRequest request, const Shard& part,
              const EarlierPlan& earlier, std::optional<SearchQuestion> question,
              PlanningSession& session, std::chrono::steady_clock::time_point start);

  // Plans and writes the files.
  absl::Status Run();
  // Prints a summary of the plan.
  void Print() const;

 private:
  bool GoesOn() const;
  void AddTiming(const std::string& name, double seconds);
  void Enter(const ProgressPhase& phase);
  void Show(double fraction, const std::string& text);

  // Runs one search for the plan; sets result_, document_ and bound_.
  absl::Status Search();
  // Plans a Pareto front.
  absl::Status SearchFront();
  BoundedPlanHooks Hooks();
  void BeginStep(PlanStep step);
  void EndStep(PlanStep step, double seconds);
  void ShowBound(const ScanCountBoundProgress& progress);

  // Runs every start of this shard in sequence. The best start becomes the plan, unless this is one
  // shard of several: then the results stay in the checkpoint.
  absl::Status SearchFromAllStarts(SearchCheckpoint& checkpoint);
  absl::StatusOr<StartResult> SearchFromStart(int index, SearchCheckpoint& checkpoint);
  // Sets document_ and bound_ from a search that has ended, in this process or another.
  absl::Status TakeStart(const StartResult& start);

  // Writes plan.json for the first plan, and again for every better one.
  absl::Status Describe(const PlannerResult& result);
  absl::Status WritePlan();
  absl::Status PlanOptically();

  PlanOptions& options_;
  const Shard part_;
  const EarlierPlan& earlier_;
  const std::optional<SearchQuestion> question_;
  PlanningSession& session_;
  PlannerRequest request_;
  std::chrono::steady_clock::time_point start_;
  ProgressLine progress_;
  ProgressPhase search_phase_;
  std::string search_name_;  // prefix of all progress texts if there are several searches
  PlannerResult result_;
  PlanDocument document_;
  std::optional<ScanCountBoundResult> bound_;
  double time_to_plan_s_ = 0;
};

}  // namespace sightline
