// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/planning_run.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "planner_client/command_line/help/terminal.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/optics/optics_outputs.h"
#include "planner_client/commands/optics/plan_with_optics.h"
#include "planner_client/commands/planning/pareto_outputs.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/commands/starts/plan_starts.h"
#include "planning/pareto/frame_estimate.h"
#include "planning/strategy/execution/execution_model.h"
#include "planning/strategy/scan_order.h"
#include "report/optics/optics_report.h"

namespace sightline {
namespace {

// Fractions of the whole command, by times for the example head. Opening the session comes before,
// writing outputs after.
constexpr ProgressPhase kPlanningPhase{kOpenSessionPhase.end, 0.5};
constexpr ProgressPhase kBoundPhase{0.5, 0.7};
constexpr ProgressPhase kAgainPhase{0.7, 0.87};
constexpr ProgressPhase kLeastTimePhase{0.87, 0.95};

struct StepDescription {
  ProgressPhase phase;
  const char* timing;
};

StepDescription DescriptionOf(PlanStep step) {
  switch (step) {
    case PlanStep::kPlan:
      return {kPlanningPhase, "planning"};
    case PlanStep::kBound:
      return {kBoundPhase, "lower bound"};
    case PlanStep::kPlanAgain:
      return {kAgainPhase, "planning with the bound's scans"};
    case PlanStep::kLeastTime:
      break;
  }
  return {kLeastTimePhase, "planning fewer set-ups"};
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// optics.json, its report, and the settings of the plan's scans.
absl::Status WriteOptics(const v1::OpticsPlan& optics, const std::string& folder, v1::Plan* plan) {
  v1::OpticsPlan named = optics;
  named.set_sightline_version(SIGHTLINE_VERSION);
  SetSettings(named, plan);
  for (const std::string& warning : named.warnings()) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
  SIGHTLINE_RETURN_IF_ERROR(WriteOpticsJson(named, folder + "/optics.json"));
  return WriteOpticsReport(named, nullptr, folder + "/optics.html");
}

// The permitted time must leave some for scans.
absl::Status CheckExecutionTime(const std::string& inspection_file, const PlannerRequest& request) {
  const double before_s = TimesBeforeFirst(request.execution).Total_s();
  const std::optional<double>& permitted_s = request.goal.execution_time_s;
  if (!permitted_s || *permitted_s > before_s) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat(inspection_file, ": goal.execution_time_s (--goal-time-s) is ",
                   NumberText(*permitted_s), " s, must be above ", NumberText(before_s),
                   " s: so long it takes to place the sensors and to lay the part before the first "
                   "scan (costs)"));
}

}  // namespace

PlanningRun::PlanningRun(PlanOptions& options, PlannerRequest request, const Shard& part,
                         const EarlierPlan& earlier, std::optional<SearchQuestion> question,
                         PlanningSession& session, std::chrono::steady_clock::time_point start)
    : options_(options),
      part_(part),
      earlier_(earlier),
      question_(std::move(question)),
      session_(session),
      request_(std::move(request)),
      start_(start),
      progress_(kPlanningPhase),
      search_phase_{kPlanningPhase.begin, kLeastTimePhase.end} {
  const SceneInfo& scene = session_.client->scene();
  AddTiming("target points", scene.targets_time_s);
  AddTiming("visibility data", scene.field_time_s);
  AddTiming("measurability", scene.measurability_time_s);
  AddTiming("loading, upload and start of the server", session_.open_time_s - scene.targets_time_s -
                                                           scene.field_time_s -
                                                           scene.measurability_time_s);
  SetGoal(options_, session_.inspection.goal);
  request_.domain = session_.inspection.domain;
  request_.goal = session_.inspection.goal;
  request_.execution = ExecutionModelOf(session_.inspection);
  request_.scan_time_s =
      [this, frames = FrameEstimate(session_.inspection.rig, session_.client->scene().part_centre_m,
                                    session_.client->targets())](const Measurement& scan) {
        const FrameRange range = frames.Frames(scan);
        return ScanTimeS(session_.inspection.costs, session_.inspection.rig.scan_step_m,
                         range.first, range.last);
      };
  SetOptions(options_, request_);
  request_.on_progress = [this](const PlanProgress& p) {
    Show(p.done,
         absl::StrFormat("%d scans, %.1f %% %s, %dk evaluations: %s", p.scans, 100 * p.coverage,
                         session_.ForUncertainty() ? "admissible" : "covered", p.evaluations / 1000,
                         p.phase));
  };
}

absl::Status PlanningRun::Run() {
  SIGHTLINE_RETURN_IF_ERROR(CheckExecutionTime(options_.session.inspection_file, request_));
  absl::StatusOr<SearchCheckpoint> checkpoint;
  if (question_) {
    checkpoint = SearchCheckpoint::Open(options_.checkpoint, session_, *question_, request_,
                                        options_.bound_evaluations);
  } else {
    checkpoint.emplace();
  }
  if (!checkpoint.ok()) return checkpoint.status();
  if (options_.starts.Several()) {
    SIGHTLINE_RETURN_IF_ERROR(SearchFromAllStarts(*checkpoint));
    if (!part_.IsWhole()) return absl::OkStatus();
  } else {
    SIGHTLINE_RETURN_IF_ERROR(checkpoint->KeepAnswers("", &session_));
    SIGHTLINE_RETURN_IF_ERROR(Search());
  }
  if (options_.optics && GoesOn()) {
    SIGHTLINE_RETURN_IF_ERROR(PlanOptically());
  }
  if (bound_) SetBound(session_, *bound_, document_.plan);
  return WritePlanOutputs(session_, document_, options_.output);
}

void PlanningRun::Print() const {
  if (!part_.IsWhole()) {
    if (!InterruptFlag()) PrintText("shard %d of %d is done\n", part_.number, part_.count);
    return;
  }
  PrintWrapped(absl::StrFormat(
      "%s%s%s%.1f s from cold start to plan, %.1f s in all with lower bound, better plans, "
      "reasons, "
      "pictures and files.\n",
      SummarisePlan(document_.plan), SummariseStarts(document_.plan),
      SummariseAsMeasured(document_.plan), time_to_plan_s_, SecondsSince(start_)));
  if (options_.output.pareto) {
    PrintText("%s", SummarisePareto(*options_.output.pareto).c_str());
  }
  PrintText("plan:   %s\nreport: %s\n",
            std::filesystem::absolute(options_.output.folder + "/plan.json").c_str(),
            std::filesystem::absolute(options_.output.folder + "/report.html").c_str());
}

bool PlanningRun::GoesOn() const { return !InterruptFlag() && !document_.scans.empty(); }

void PlanningRun::AddTiming(const std::string& name, double seconds) {
  options_.output.timings.push_back({name, seconds});
}

// Phases of a search are parts of `search_phase_`.
void PlanningRun::Enter(const ProgressPhase& phase) {
  const double scale =
      (search_phase_.end - search_phase_.begin) / (kLeastTimePhase.end - kPlanningPhase.begin);
  progress_.Enter({search_phase_.begin + (phase.begin - kPlanningPhase.begin) * scale,
                   search_phase_.begin + (phase.end - kPlanningPhase.begin) * scale});
}

void PlanningRun::Show(double fraction, const std::string& text) {
  progress_.Show(fraction, search_name_ + text);
}

absl::Status PlanningRun::Search() {
  if (options_.pareto.front) return SearchFront();
  SIGHTLINE_ASSIGN_OR_RETURN(auto found, MakeBoundedPlan(*session_.gain_model, request_,
                                                         options_.bound_evaluations, Hooks()));
  result_ = std::move(found.plan);
  bound_ = std::move(found.bound);
  return absl::OkStatus();
}

absl::Status PlanningRun::SearchFront() {
  // All plans of a front profit from the bound's scans.
  if (options_.bound_evaluations > 0) {
    BeginStep(PlanStep::kBound);
    const auto bound_start = std::chrono::steady_clock::now();
    auto bound = BoundScanCount(
        *session_.gain_model, request_.domain, GoalFraction(request_.goal), {},
        options_.bound_evaluations, request_.seed,
        [this](const ScanCountBoundProgress& p) { ShowBound(p); }, &InterruptFlag());
    EndStep(PlanStep::kBound, SecondsSince(bound_start));
    if (!bound.ok()) return bound.status();
    bound_ = *std::move(bound);
    request_.candidates = bound_->generated_columns;
  }
  BeginStep(PlanStep::kPlan);
  const auto plan_start = std::chrono::steady_clock::now();
  auto result = PlanFront(session_, request_, progress_, &options_.output);
  EndStep(PlanStep::kPlan, SecondsSince(plan_start));
  if (!result.ok()) return result.status();
  result_ = *std::move(result);
  return Describe(result_);
}

BoundedPlanHooks PlanningRun::Hooks() {
  BoundedPlanHooks hooks;
  hooks.on_begin = [this](PlanStep step) { BeginStep(step); };
  hooks.on_end = [this](PlanStep step, double seconds) { EndStep(step, seconds); };
  hooks.on_bound = [this](const ScanCountBoundProgress& progress) { ShowBound(progress); };
  hooks.on_plan = [this](const PlannerResult& plan) { return Describe(plan); };
  return hooks;
}

void PlanningRun::BeginStep(PlanStep step) { Enter(DescriptionOf(step).phase); }

void PlanningRun::EndStep(PlanStep step, double seconds) {
  progress_.Finish();
  AddTiming(search_name_ + DescriptionOf(step).timing, seconds);
  if (step == PlanStep::kPlan) time_to_plan_s_ = SecondsSince(start_);
}

void PlanningRun::ShowBound(const ScanCountBoundProgress& progress) {
  Show(static_cast<double>(progress.evaluations) / static_cast<double>(progress.budget),
       absl::StrFormat("relaxation so far: %.2f scans", progress.bound));
}

absl::Status PlanningRun::SearchFromAllStarts(SearchCheckpoint& checkpoint) {
  std::vector<StartResult> starts;
  size_t best = 0;
  for (int i = part_.number - 1; i < options_.starts.count; i += part_.count) {
    // After an interruption, the starts planned so far give the plan.
    if (InterruptFlag() && !starts.empty()) break;
    SIGHTLINE_ASSIGN_OR_RETURN(auto start, SearchFromStart(i, checkpoint));
    starts.push_back(std::move(start));
    if (!part_.IsWhole()) continue;
    if (starts.size() > 1 && !IsBetterStart(starts.back(), starts[best])) continue;
    best = starts.size() - 1;
    SIGHTLINE_RETURN_IF_ERROR(TakeStart(starts[best]));
    SIGHTLINE_RETURN_IF_ERROR(WritePlan());
  }
  time_to_plan_s_ = SecondsSince(start_);
  if (!part_.IsWhole()) return absl::OkStatus();
  // Starts of other processes that ended meanwhile have stored their results.
  SIGHTLINE_RETURN_IF_ERROR(TakeStart(starts[best]));
  SetStarts(starts, document_.plan);
  return absl::OkStatus();
}

absl::StatusOr<StartResult> PlanningRun::SearchFromStart(int index, SearchCheckpoint& checkpoint) {
  const int count = options_.starts.count;
  request_.seed = options_.seed + index;
  if (auto kept = checkpoint.ResultOf(request_.seed)) return *std::move(kept);
  const double begin = kPlanningPhase.begin;
  const double width = kLeastTimePhase.end - begin;
  search_phase_ = {begin + width * index / count, begin + width * (index + 1) / count};
  search_name_ = absl::StrFormat("start %d of %d: ", index + 1, count);
  const std::string name = absl::StrCat("-", request_.seed);
  bound_.reset();
  SIGHTLINE_RETURN_IF_ERROR(checkpoint.KeepAnswers(name, &session_));
  const absl::Status searched = Search();
  checkpoint.LeaveAnswers(&session_);
  if (!searched.ok()) return searched;
  StartResult start = StartOf(result_, document_.plan, bound_);
  // An interrupted search continues in a later run.
  if (InterruptFlag()) return start;
  SIGHTLINE_RETURN_IF_ERROR(checkpoint.KeepResult(start, name));
  return start;
}

absl::Status PlanningRun::TakeStart(const StartResult& start) {
  SIGHTLINE_ASSIGN_OR_RETURN(auto scans, ScansOfStart(session_, start));
  SIGHTLINE_ASSIGN_OR_RETURN(document_,
                             MakePlanDocument(session_, std::move(scans),
                                              {options_.strategy, start.seed, start.evaluations,
                                               StopReasonToProto(start.stop_reason)}));
  bound_ = start.bound;
  return absl::OkStatus();
}

absl::Status PlanningRun::Describe(const PlannerResult& result) {
  SIGHTLINE_ASSIGN_OR_RETURN(document_,
                             MakePlanDocument(session_, result.scans,
                                              {options_.strategy, request_.seed, result.evaluations,
                                               StopReasonToProto(result.stop_reason)}));
  // With several searches, only the best plan is written.
  if (options_.starts.Several()) return absl::OkStatus();
  if (!earlier_.files.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(DescribeAsMeasured(earlier_, session_, &document_));
  }
  return WritePlan();
}

absl::Status PlanningRun::WritePlan() {
  // Settings of an earlier plan's scans; with --optics they are made anew.
  const std::string& folder = options_.output.folder;
  SIGHTLINE_RETURN_IF_ERROR(
      RemoveFiles(folder, {"optics.json", "optics.html", "optics_report.json"}));
  return WritePlanJson(document_, folder);
}

absl::Status PlanningRun::PlanOptically() {
  const auto optics_start = std::chrono::steady_clock::now();
  SIGHTLINE_ASSIGN_OR_RETURN(
      const auto optics, PlanWithOptics({options_.session, options_.output.folder,
                                         options_.optics_rounds, options_.seed, options_.worker},
                                        request_, &session_, &document_));
  AddTiming("planning with optics", SecondsSince(optics_start));
  return WriteOptics(optics, options_.output.folder, &document_.plan);
}

}  // namespace sightline
