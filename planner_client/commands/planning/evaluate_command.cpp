// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "planner_client/command_line/help/terminal.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/other_part.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planning/plan_file/plan_file.h"

namespace sightline {
namespace {

// The given scans keep their settings; their order may be another one.
void KeepSettings(const PlanFileScans& given, PlanDocument& document) {
  for (size_t i = 0; i < document.scans.size(); ++i) {
    const auto scan = std::find(given.all.begin(), given.all.end(), document.scans[i].measurement);
    if (scan == given.all.end()) continue;
    const v1::PlannedScan& from = given.plan.scans(static_cast<int>(scan - given.all.begin()));
    if (!from.has_setting()) continue;
    *document.plan.mutable_scans(static_cast<int>(i))->mutable_setting() = from.setting();
  }
}

}  // namespace

Command AddEvaluateCommand(CLI::App& app) {
  struct Options {
    SessionOptions session;
    OutputOptions output;
    std::string plan;
  };
  auto options = std::make_shared<Options>();
  app.add_option("inspection", options->session.inspection_file, "inspection.json")->required();
  app.add_option("plan", options->plan, "plan.json, made by hand or by `sightline plan`")
      ->required();
  app.add_option("--out", options->output.folder, "folder for plan.json, report.html, ...")
      ->required();
  app.add_option("--coverage-server", options->session.coverage_server,
                 "unix:PATH or HOST:PORT; default: an embedded server");
  AddServerTlsOptions(app, &options->session.tls);
  AddOtherPartOption(app, &options->session.plans.other_part);
  app.add_flag("!--no-pictures", options->output.pictures,
               "leave the rendered views out of the report");
  app.add_flag("!--no-point-clouds", options->output.point_clouds,
               "do not write points/scan_NN.ply");
  app.add_flag("--ellipsoids", options->output.ellipsoids,
               "for uncertainty: write points/scan_NN_ellipsoids.ply too");
  return [options]() -> int {
    auto given = ReadPlanScans(options->plan, &options->session.plans);
    if (!given.ok()) return ReportError(given.status());
    const auto out_lock = OpenOutputFolder(options->output.folder);
    if (!out_lock.ok()) return ReportError(out_lock.status());
    auto session = OpenSession(options->session);
    if (!session.ok()) return ReportError(session.status());
    options->output.timings.push_back({"loading and visibility data", session->open_time_s});
    auto exact = session->gain_model->ExactCoverage(given->all);
    if (!exact.ok()) return ReportError(exact.status());
    auto fast = session->client->FastCoverage(given->all);
    if (!fast.ok()) return ReportError(fast.status());
    std::vector<ChosenScan> scans;
    for (size_t i = 0; i < given->all.size(); ++i) {
      scans.push_back({.measurement = given->all[i],
                       .locked = given->locked[i],
                       .exact = std::move((*exact)[i]),
                       .fast_covered = (*fast)[i].covered.Count()});
    }
    PlanSource source{given->plan.strategy(), given->plan.seed(), given->plan.gain_evaluations(),
                      v1::Plan::STOP_REASON_EVALUATED};
    auto made = MakePlanDocument(*session, std::move(scans), source);
    if (!made.ok()) return ReportError(made.status());
    PlanDocument& document = *made;
    KeepSettings(*given, document);
    if (absl::Status status = WritePlanOutputs(*session, document, options->output); !status.ok())
      return ReportError(status);
    PrintWrapped(SummarisePlan(document.plan));
    PrintText("plan:   %s\nreport: %s\n",
              std::filesystem::absolute(options->output.folder + "/plan.json").c_str(),
              std::filesystem::absolute(options->output.folder + "/report.html").c_str());
    return kExitDone;
  };
}

}  // namespace sightline
