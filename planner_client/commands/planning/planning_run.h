// SPDX-License-Identifier: Apache-2.0
// One run of `sightline plan` on a session that is open: searches, the plan that they find, and its
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
  // `part`: the starts that this process runs. `question`: set if answers are kept. `start`: when
  // the command began.
  PlanningRun(PlanOptions& options, PlannerRequest request, const Shard& part,
              const EarlierPlan& earlier, std::optional<SearchQuestion> question,
              PlanningSession& session, std::chrono::steady_clock::time_point start);

  // Plans and writes the files.
  absl::Status Run();
  // The plan in words.
  void Print() const;

 private:
  bool GoesOn() const;
  void AddTiming(const std::string& name, double seconds);
  void Enter(const ProgressPhase& phase);
  void Show(double fraction, const std::string& text);

  // One search for the plan: result_, document_ and bound_.
  absl::Status Search();
  // The plans of a Pareto front.
  absl::Status SearchFront();
  BoundedPlanHooks Hooks();
  void BeginStep(PlanStep step);
  void EndStep(PlanStep step, double seconds);
  void ShowBound(const ScanCountBoundProgress& progress);

  // Every start of this part, one after the other. The best of all starts becomes the plan, unless
  // this is a part of them: then their results stay in the checkpoint.
  absl::Status SearchFromAllStarts(SearchCheckpoint& checkpoint);
  absl::StatusOr<StartResult> SearchFromStart(int index, SearchCheckpoint& checkpoint);
  // document_ and bound_ of a search that has ended, here or elsewhere.
  absl::Status TakeStart(const StartResult& start);

  // plan.json appears as soon as there is a plan, and again when there is a better one.
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
  std::string search_name_;  // of several: before all that is shown of a search
  PlannerResult result_;
  PlanDocument document_;
  std::optional<ScanCountBoundResult> bound_;
  double time_to_plan_s_ = 0;
};

}  // namespace sightline
