// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/pareto_outputs.h"

#include <cstdio>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planning/pareto/frame_estimate.h"
#include "planning/pareto/make_pareto_front.h"
#include "planning/strategy/plan_run.h"

namespace sightline {
namespace {

ParetoTask TaskOf(const PlanningSession& session, const PlanningGoal& goal) {
  const SceneInfo& scene = session.client->scene();
  ParetoTask task;
  task.inspection_name = session.inspection.name;
  task.sightline_version = SIGHTLINE_VERSION;
  task.part_digest = session.part_digest;
  task.part_file = session.inspection.part_file;
  task.scene_digest = scene.scene_digest;
  task.costs = session.inspection.costs;
  task.domain = session.inspection.domain;
  task.for_uncertainty = session.ForUncertainty();
  task.goal = GoalFraction(goal);
  task.judged_targets = session.gain_model->measurable().Count();
  task.fresh_judged_targets = session.gain_model->validation_measurable().Count();
  return task;
}

absl::Status WriteFront(const v1::ParetoFront& front, const std::string& folder) {
  SIGHTLINE_RETURN_IF_ERROR(MakeOutputFolder(folder));
  return WriteFileAtomically(folder + "/pareto.json", ToJson(front));
}

// The point's scans, evaluated exactly again.
absl::StatusOr<std::vector<ChosenScan>> EvaluateAgain(const PlanningSession& session,
                                                      const v1::ParetoPoint& point,
                                                      const std::string& path) {
  PlannerRequest request;
  request.domain = session.inspection.domain;
  request.goal = session.inspection.goal;
  request.goal.max_time_s.reset();
  PlanRun run(*session.gain_model, request);
  const std::vector<Measurement> measurements = ScansOfPoint(point);
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, run.Exact(measurements));
  SIGHTLINE_ASSIGN_OR_RETURN(auto fast, session.gain_model->FastCoverage(measurements));
  std::vector<ChosenScan> scans;
  std::vector<FrameRange> frames;
  for (size_t i = 0; i < measurements.size(); ++i) {
    const ScanCoverage& coverage = *exact[i];
    if (coverage.feasibility != ScanFeasibility::kFeasible) {
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": points[", point.number() - 1, "].measurements[", i,
                       "] is not feasible: ", FeasibilityName(coverage.feasibility)));
    }
    frames.push_back({coverage.first_frame, coverage.last_frame});
    scans.push_back({.measurement = measurements[i],
                     .locked = static_cast<int>(i) < point.locked_scans(),
                     .exact = coverage,
                     .fast_covered = fast[i].covered.Count()});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto score, run.Score(measurements, true));
  const PlanTime time =
      TimeOfPlan(ExecutionModelOf(session.inspection), session.inspection.rig.scan_step_m,
                 measurements, frames, point.locked_scans());
  SIGHTLINE_RETURN_IF_ERROR(CheckSameNumbers(point, score, time, path));
  return scans;
}

}  // namespace

void AddParetoOptions(CLI::App& app, ParetoOptions* options) {
  app.add_flag("--pareto", options->front,
               "also plan with fewer and more scans and for less time, and write the trade-off: "
               "pareto.json");
  app.add_option("--pick", options->pick.number,
                 "plan and report of this point of the pareto.json in --out, without planning "
                 "again");
  app.add_option("--pick-scans", options->pick.scans,
                 "the same for the point that satisfies most targets with at most so many scans")
      ->check(CLI::Range(1, 1000));
  app.add_option("--pick-seconds", options->pick.seconds,
                 "the same for the point that satisfies most targets within so many seconds")
      ->check(CLI::NonNegativeNumber);
}

absl::Status CheckParetoOptions(const ParetoOptions& options, const std::string& strategy,
                                const std::string& other) {
  const int picks =
      (options.pick.number ? 1 : 0) + (options.pick.scans ? 1 : 0) + (options.pick.seconds ? 1 : 0);
  if (picks > 1) {
    return absl::InvalidArgumentError("--pick, --pick-scans and --pick-seconds exclude each other");
  }
  if (picks > 0 && options.front) {
    return absl::InvalidArgumentError(
        "--pareto and --pick exclude each other: first plan the front, then pick of it");
  }
  if ((picks > 0 || options.front) && !other.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.front ? "--pareto" : "--pick", " and ", other, " exclude each other"));
  }
  if (options.front && strategy != "refined") {
    return absl::InvalidArgumentError(
        absl::StrCat("--pareto: needs --strategy refined, not ", strategy));
  }
  return absl::OkStatus();
}

absl::StatusOr<PlannerResult> PlanFront(const PlanningSession& session,
                                        const PlannerRequest& request, ProgressLine& progress,
                                        OutputOptions* output) {
  if (session.robot) {
    PrintTextTo(stderr,
                "warning: rig.robot: --pareto counts the seconds of `costs` without the robot's "
                "moves; its scans are all within the robot's reach\n");
  }
  const FrameEstimate estimate(session.inspection.rig, session.client->scene().part_centre_m,
                               session.client->targets());
  ParetoRequest front;
  front.plan = request;
  front.execution = request.execution;
  front.scan_step_m = session.inspection.rig.scan_step_m;
  front.estimate_frames = [&](const Measurement& scan) { return estimate.Frames(scan); };
  front.on_progress = [&](double fraction, const std::string& text) {
    progress.Show(fraction, text);
  };
  SIGHTLINE_ASSIGN_OR_RETURN(auto made, MakeParetoFront(*session.gain_model, front));
  const size_t chosen = *PointForGoal(made.front.points);
  output->pareto = ParetoToProto(made, TaskOf(session, request.goal), request.seed, chosen,
                                 StopReasonToProto(made.stop_reason));
  SIGHTLINE_RETURN_IF_ERROR(WriteFront(*output->pareto, output->folder));
  PlannerResult plan;
  plan.scans = std::move(made.front.points[chosen].scans);
  plan.score = made.front.points[chosen].score;
  plan.stop_reason = made.stop_reason;
  // Reason why the plan for the goal stopped; the front only states that it missed the goal.
  if (plan.stop_reason == StopReason::kStalled) plan.stop_reason = made.plan_stop_reason;
  plan.evaluations = made.evaluations;
  return plan;
}

int RunPick(const SessionOptions& session_options, const ParetoPick& pick, OutputOptions output) {
  const std::string path = output.folder + "/pareto.json";
  v1::ParetoFront front;
  if (absl::Status status = ReadStrictJsonFile(path, &front); !status.ok()) {
    return ReportError(status);
  }
  // A missing pick is reported before the scene is built.
  const auto index = PickPoint(front, pick, path);
  if (!index.ok()) return ReportError(index.status());
  const auto out_lock = OpenOutputFolder(output.folder);
  if (!out_lock.ok()) return ReportError(out_lock.status());
  auto session = OpenSession(session_options);
  if (!session.ok()) return ReportError(session.status());
  output.timings.push_back({"loading and visibility data", session->open_time_s});
  // The front states its goal, which may differ from the inspection's present one.
  PlanningGoal& goal = session->inspection.goal;
  (goal.admissible ? *goal.admissible : goal.coverage) = front.goal();
  std::string remark;
  if (absl::Status status = CheckPareto(front, TaskOf(*session, goal), path, &remark);
      !status.ok()) {
    return ReportError(status);
  }
  if (!remark.empty()) {
    PrintTextTo(stderr, "warning: %s\n", remark.c_str());
    session->plan_remarks.push_back(std::move(remark));
  }
  const v1::ParetoPoint point = front.points(*index);
  auto scans = EvaluateAgain(*session, point, path);
  if (!scans.ok()) return ReportError(scans.status());
  const PlanSource source{"refined", front.seed(), front.gain_evaluations(),
                          v1::Plan::STOP_REASON_EVALUATED};
  auto document = MakePlanDocument(*session, *std::move(scans), source);
  if (!document.ok()) return ReportError(document.status());
  if (auto status =
          RemoveFiles(output.folder, {"optics.json", "optics.html", "optics_report.json"});
      !status.ok()) {
    return ReportError(status);
  }
  front.set_chosen(point.number());
  if (absl::Status status = WriteFront(front, output.folder); !status.ok()) {
    return ReportError(status);
  }
  output.pareto = std::move(front);
  if (absl::Status status = WritePlanOutputs(*session, *document, output); !status.ok()) {
    return ReportError(status);
  }
  PrintText("point %d: %splan:   %s\nreport: %s\n", point.number(),
            SummarisePlan(document->plan).c_str(),
            std::filesystem::absolute(output.folder + "/plan.json").c_str(),
            std::filesystem::absolute(output.folder + "/report.html").c_str());
  return kExitDone;
}

}  // namespace sightline
