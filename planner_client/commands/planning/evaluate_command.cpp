#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"
#include "planner_client/commands/output_folder.h"
#include "planner_client/commands/planning/plan_document.h"
#include "planner_client/commands/planning/planning_session.h"

namespace sightline {
namespace {

const char* Words(ScanFeasibility feasibility) {
  switch (feasibility) {
    case ScanFeasibility::kFeasible:
      return "feasible";
    case ScanFeasibility::kCollision:
      return "camera or laser would collide; it counts for nothing";
    case ScanFeasibility::kTravel:
      return "needs more stage travel than there is; it counts for nothing";
    case ScanFeasibility::kOutOfBounds:
      return "is out of bounds; it counts for nothing";
  }
  return "";
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
                 "unix:PATH or HOST:PORT; default: one of our own");
  app.add_flag("!--no-pictures", options->output.pictures,
               "leave the rendered views out of the report");
  app.add_flag("!--no-point-clouds", options->output.point_clouds,
               "do not write points/scan_NN.ply");
  app.add_flag("--ellipsoids", options->output.ellipsoids,
               "for uncertainty: write points/scan_NN_ellipsoids.ply too");
  return [options]() -> int {
    auto given = ReadPlanScans(options->plan);
    if (!given.ok()) return ReportError(given.status());
    const auto out_lock = OpenOutputFolder(options->output.folder);
    if (!out_lock.ok()) return ReportError(out_lock.status());
    auto session = OpenSession(options->session);
    if (!session.ok()) return ReportError(session.status());
    options->output.timings.push_back({"loading and visibility data", session->open_time_s});
    auto exact = session->oracle->ExactCoverage(given->all);
    if (!exact.ok()) return ReportError(exact.status());
    auto fast = session->client->FastCoverage(given->all);
    if (!fast.ok()) return ReportError(fast.status());
    std::vector<ChosenScan> scans;
    for (size_t i = 0; i < given->all.size(); ++i) {
      if ((*exact)[i].feasibility != ScanFeasibility::kFeasible) {
        std::printf("scan %zu %s\n", i + 1, Words((*exact)[i].feasibility));
      }
      scans.push_back({.measurement = given->all[i],
                       .locked = given->locked[i],
                       .exact = std::move((*exact)[i]),
                       .fast_covered = (*fast)[i].covered.Count()});
    }
    PlanSource source{given->plan.strategy(), given->plan.seed(), given->plan.gain_evaluations(),
                      v1::Plan::STOP_REASON_EVALUATED};
    const auto made = MakePlanDocument(*session, std::move(scans), source);
    if (!made.ok()) return ReportError(made.status());
    const PlanDocument& document = *made;
    if (absl::Status status = WritePlanOutputs(*session, document, options->output); !status.ok())
      return ReportError(status);
    std::printf("%splan:   %s\nreport: %s\n", SummarisePlan(document.plan).c_str(),
                std::filesystem::absolute(options->output.folder + "/plan.json").c_str(),
                std::filesystem::absolute(options->output.folder + "/report.html").c_str());
    return kExitDone;
  };
}

}  // namespace sightline
