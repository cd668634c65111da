// SPDX-License-Identifier: Apache-2.0
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/inspection/read_with_files.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/other_part.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/planning/plan_outputs.h"
#include "planner_client/commands/planning/session/planning_session.h"
#include "planner_client/commands/planning/session/robot_outputs.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/explore/explore_routes.h"
#include "planner_client/explore/explore_session.h"
#include "planner_client/gain_model/coverage_gain_model.h"
#include "planning/plan_file/plan_file.h"
#include "planning_service/http/http_server.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct ExploreOptions {
  SessionOptions session;
  WorkerSessionOptions worker;
  std::string listen = "127.0.0.1:8090";
  bool allow_plaintext = false;
  std::vector<std::string> hosts;
  std::string plan;
  std::string folder;
};

// The source of images, or the reason why there are none.
struct Pictures {
  std::unique_ptr<EmbeddedServer> worker;
  DrawDraft draw;
  std::string missing;
};

// Only images need a render worker; everything else works without it.
Pictures OpenPictures(const ExploreOptions& options) {
  Pictures pictures;
  const std::string& file = options.session.inspection_file;
  const auto without = [&](const absl::Status& status) {
    pictures.missing = std::string(status.message());
    return std::move(pictures);
  };
  v1::Inspection message;
  if (absl::Status read = ReadStrictJsonFile(file, &message); !read.ok()) return without(read);
  auto checked = CheckImagingInspection(message, file);
  if (!checked.ok()) return without(checked.status());
  std::vector<AssetFile> assets;
  absl::Status taken = TakeAssets(file, &checked->message, &assets);
  if (!taken.ok()) return without(taken);
  WorkerClientOptions client;
  auto worker = StartWorkerSession(options.worker, nullptr, &client);
  if (!worker.ok()) return without(worker.status());
  pictures.worker = *std::move(worker);
  pictures.draw = DrawWithWorker(std::move(checked->message), std::move(assets), client);
  return pictures;
}

absl::StatusOr<std::unique_ptr<HttpServer>> ListenForPage(const ExploreOptions& options) {
  HttpServerOptions http;
  http.option = "--listen";
  http.listen = options.listen;
  http.max_connections = 32;
  http.max_request_bytes = kMaxExploreRequestBytes;
  SIGHTLINE_ASSIGN_OR_RETURN(auto server, HttpServer::Listen(http));
  if (!server->listening().is_loopback && !options.allow_plaintext) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--listen ", options.listen,
        ": everybody who reaches this address could read and change the plan, without encryption; "
        "listen on 127.0.0.1, or add --allow-plaintext on a network that you trust"));
  }
  return server;
}

absl::StatusOr<std::vector<ExploredScan>> ReadFirstScans(const std::string& file,
                                                         GivenPlans* plans) {
  std::vector<ExploredScan> scans;
  if (file.empty()) return scans;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto given, ReadPlanScans(file, plans));
  for (size_t i = 0; i < given.all.size(); ++i) {
    const v1::PlannedScan& planned = given.plan.scans(static_cast<int>(i));
    ExploredScan scan;
    scan.measurement = given.all[i];
    scan.locked = given.locked[i];
    if (planned.has_setting()) scan.setting = planned.setting();
    scans.push_back(std::move(scan));
  }
  return scans;
}

// Settings of the scans; their order in the plan may differ.
void SetScanSettings(const std::vector<ExploredScan>& scans, v1::Plan* plan) {
  std::vector<bool> used(scans.size(), false);
  for (v1::PlannedScan& planned : *plan->mutable_scans()) {
    const std::string wanted = planned.measurement().SerializeAsString();
    for (size_t i = 0; i < scans.size(); ++i) {
      if (used[i] || MeasurementToProto(scans[i].measurement).SerializeAsString() != wanted) {
        continue;
      }
      used[i] = true;
      if (scans[i].setting) *planned.mutable_setting() = *scans[i].setting;
      break;
    }
  }
}

// Writes the files of `sightline evaluate` without pictures and points, which would take long.
absl::StatusOr<SavedPlan> SavePlan(PlanningSession& session, const std::string& folder,
                                   const std::vector<ExploredScan>& scans) {
  std::vector<Measurement> measurements;
  for (const ExploredScan& scan : scans) measurements.push_back(scan.measurement);
  SIGHTLINE_ASSIGN_OR_RETURN(auto exact, session.gain_model->ExactCoverage(measurements));
  SIGHTLINE_ASSIGN_OR_RETURN(auto fast, session.client->FastCoverage(measurements));
  std::vector<ChosenScan> chosen;
  for (size_t i = 0; i < scans.size(); ++i) {
    chosen.push_back({.measurement = measurements[i],
                      .locked = scans[i].locked,
                      .exact = std::move(exact[i]),
                      .fast_covered = fast[i].covered.Count()});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto document,
      MakePlanDocument(session, std::move(chosen),
                       {.strategy = "explore", .stop_reason = v1::Plan::STOP_REASON_EVALUATED}));
  SetScanSettings(scans, &document.plan);
  OutputOptions output;
  output.folder = folder;
  output.pictures = false;
  output.point_clouds = false;
  // These files describe the scans of an earlier plan.
  SIGHTLINE_RETURN_IF_ERROR(
      RemoveFiles(folder, {"optics.json", "optics.html", "optics_report.json"}));
  SIGHTLINE_RETURN_IF_ERROR(WritePlanOutputs(session, document, output));
  SavedPlan saved;
  for (const char* name : {"plan.json", "plan.csv", "report.html", "report.json"}) {
    saved.files.push_back((fs::path(folder) / name).string());
  }
  return saved;
}

// Stores unsaved scans where --plan can read them.
absl::StatusOr<std::string> KeepUnsaved(const ExploreSession& session, const PartDigest& part,
                                        const std::string& folder) {
  v1::Plan plan;
  plan.set_part_digest(part.Text());
  for (const ExploredScan& scan : session.Scans()) {
    v1::PlannedScan& planned = *plan.add_scans();
    *planned.mutable_measurement() = MeasurementToProto(scan.measurement);
    planned.set_locked(scan.locked);
    if (scan.setting) *planned.mutable_setting() = *scan.setting;
  }
  const std::string path = (fs::path(folder) / "unsaved_plan.json").string();
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(path, ToJson(plan)));
  return path;
}

int RunExplore(ExploreOptions& options) {
  // Errors in the inspection, the plan and the address are found before the scene is built.
  const auto inspection = ReadInspectionWithFiles(options.session.inspection_file);
  if (!inspection.ok()) return ReportError(inspection.status());
  auto scans = ReadFirstScans(options.plan, &options.session.plans);
  if (!scans.ok()) return ReportError(scans.status());
  spdlog::set_default_logger(spdlog::stderr_logger_mt("explore"));
  spdlog::set_level(spdlog::level::warn);
  auto server = ListenForPage(options);
  if (!server.ok()) return ReportError(server.status());
  if (options.folder.empty()) {
    options.folder =
        (fs::path(options.session.inspection_file).parent_path() / "explored_plan").string();
  }
  const std::string folder = fs::absolute(options.folder).lexically_normal().string();
  // Locked while the page is open: another command must not replace the plan meanwhile.
  const auto out_lock = OpenOutputFolder(folder);
  if (!out_lock.ok()) return ReportError(out_lock.status());

  // Manual scans need no second sample of targets, which would double the start time.
  options.session.fresh_targets = false;
  options.session.worker = options.worker;
  auto session = OpenSession(options.session);
  if (!session.ok()) return ReportError(session.status());
  Pictures pictures = OpenPictures(options);
  if (!pictures.draw) PrintTextTo(stderr, "no pictures: %s\n", pictures.missing.c_str());

  ExploreTask task;
  task.inspection = session->inspection;
  task.part = session->part;
  task.targets = session->client->targets();
  std::unique_ptr<GainModel> within_reach;
  if (session->robot) {
    within_reach =
        WithinReach(*session, std::make_unique<CoverageGainModel>(*session->client, nullptr), {});
  }
  task.gain_model = within_reach ? within_reach.get() : session->client.get();
  if (session->gain_model->ScoresPlans()) task.judge = session->gain_model.get();
  task.draw = std::move(pictures.draw);
  task.no_pictures = pictures.missing;
  task.folder = folder;
  task.saved_before = [folder] {
    std::error_code error;
    return fs::exists(fs::path(folder) / "plan.json", error);
  };
  task.save = [&](const std::vector<ExploredScan>& given) {
    return SavePlan(*session, folder, given);
  };
  task.scans = *std::move(scans);
  auto explore = ExploreSession::Open(std::move(task));
  if (!explore.ok()) return ReportError(explore.status());
  const ExploreRoutes routes(explore->get(),
                             MakeBrowserGuard(options.hosts, (*server)->listening()));
  (*server)->Start([&routes](HttpExchange& exchange) { routes.Answer(exchange); });
  PrintText("page:   http://%s/\nplan:   %s (once it is saved)\nCtrl-C ends it.\n",
            (*server)->listening().address.c_str(), (fs::path(folder) / "plan.json").c_str());
  std::fflush(stdout);
  while (!InterruptFlag()) std::this_thread::sleep_for(std::chrono::milliseconds(50));

  (*explore)->Close();
  (*server)->Stop();
  if ((*explore)->HasUnsaved()) {
    const auto kept = KeepUnsaved(**explore, session->part_digest, folder);
    if (!kept.ok()) return ReportError(kept.status());
    PrintText("scans that were not saved: %s (go on with --plan)\n", kept->c_str());
  }
  return kExitDone;
}

}  // namespace

Command AddExploreCommand(CLI::App& app) {
  auto options = std::make_shared<ExploreOptions>();
  app.add_option("inspection", options->session.inspection_file, "inspection.json")->required();
  app.add_option("--listen", options->listen, "HOST:PORT of the page; port 0: any free one")
      ->capture_default_str();
  app.add_option("--plan", options->plan, "plan.json: begin with its scans");
  AddOtherPartOption(app, &options->session.plans.other_part);
  app.add_option("--out", options->folder,
                 "folder for the plan; default: explored_plan beside the inspection");
  app.add_option("--host", options->hosts,
                 "name of this machine in requests of browsers; may be repeated");
  app.add_flag("--allow-plaintext", options->allow_plaintext,
               "listen on an address that others reach, on a network that you trust");
  app.add_option("--coverage-server", options->session.coverage_server,
                 "unix:PATH or HOST:PORT; default: an embedded server");
  app.add_option("--field-directions", options->session.field_directions,
                 "resolution of the visibility data, a square number")
      ->check(CLI::Range(64, 65536))
      ->capture_default_str();
  AddWorkerOptions(app, &options->worker);
  return [options] {
    GiveBothServersTls(options->session.coverage_server, &options->session.tls,
                       options->worker.address, &options->worker.tls);
    return RunExplore(*options);
  };
}

}  // namespace sightline
