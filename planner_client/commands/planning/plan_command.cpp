// SPDX-License-Identifier: Apache-2.0
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <utility>

#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/planning/pareto_outputs.h"
#include "planner_client/commands/planning/plan_inputs.h"
#include "planner_client/commands/planning/plan_options.h"
#include "planner_client/commands/planning/planning_run.h"
#include "planner_client/commands/server_tls.h"

namespace sightline {
namespace {

absl::Status PlanParsed(PlanOptions& options, const Shard& part) {
  PlannerRequest request;
  SIGHTLINE_RETURN_IF_ERROR(ReadGivenScans(options, request));
  SIGHTLINE_RETURN_IF_ERROR(CheckStrategy(options.strategy));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto earlier, ReadMeasuredScans(options, request));
  const bool measured = !earlier.files.empty();
  if (measured) options.session.before_upload = PutMeasuredPart(options.measured, earlier);
  SIGHTLINE_RETURN_IF_ERROR(CheckOptics(options));
  options.session.kept_scans = request.locked;
  // Parts of the starts leave the folder to the run that chooses.
  std::optional<FileLock> out_lock;
  if (part.IsWhole()) {
    SIGHTLINE_ASSIGN_OR_RETURN(out_lock, OpenOutputFolder(options.output.folder));
  }
  const auto start = std::chrono::steady_clock::now();
  SIGHTLINE_ASSIGN_OR_RETURN(auto question, QuestionOf(options));
  SIGHTLINE_ASSIGN_OR_RETURN(auto session, OpenSession(options.session));
  if (measured) {
    SIGHTLINE_RETURN_IF_ERROR(AskMeasuredPoints(earlier, &session));
  }
  PlanningRun planning(options, std::move(request), part, earlier, std::move(question), session,
                       start);
  if (auto status = planning.Run(); !status.ok()) return status;
  planning.Print();
  return absl::OkStatus();
}

int RunPlan(PlanOptions& options) {
  const char* other = options.optics                    ? "--optics"
                      : !options.measured.files.empty() ? "--measured"
                                                        : "";
  if (absl::Status s = CheckParetoOptions(options.pareto, options.strategy, other); !s.ok()) {
    return ReportError(s);
  }
  const auto part =
      CheckStartsOptions(options.starts, options.seed, options.checkpoint,
                         options.pareto.front || options.pareto.Picks() ? "--pareto" : other);
  if (!part.ok()) return ReportError(part.status());
  if (options.pareto.Picks()) {
    return RunPick(options.session, options.pareto.pick, options.output);
  }
  if (absl::Status s = PlanParsed(options, *part); !s.ok()) return ReportError(s);
  return InterruptFlag() ? kExitInterrupted : kExitDone;
}

}  // namespace

Command AddPlanCommand(CLI::App& app) {
  auto options = std::make_shared<PlanOptions>();
  AddPlanOptions(app, options.get());
  return [&app, options] {
    if (absl::Status alone = CheckPickAlone(app); !alone.ok()) return ReportError(alone);
    if (app.count("--matrix-samples") > 0 && options->strategy != kMatrixStrategy) {
      PrintTextTo(stderr, "warning: --matrix-samples has no effect without --strategy %s\n",
                  kMatrixStrategy);
    }
    GiveBothServersTls(options->session.coverage_server, &options->session.tls,
                       options->worker.address, &options->worker.tls);
    options->session.worker = options->worker;
    return RunPlan(*options);
  };
}

}  // namespace sightline
