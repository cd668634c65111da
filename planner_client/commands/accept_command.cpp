// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/acceptance/acceptance_settings.h"
#include "core/command_options/option_values.h"
#include "core/file/atomic_write.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/process_folder/process_folder.h"
#include "core/status/status_macros.h"
#include "planner_client/acceptance/acceptance_report.h"
#include "planner_client/acceptance/artefact_mesh.h"
#include "planner_client/acceptance/run_acceptance.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/worker_session.h"
#include "report/document/report_page.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct AcceptOptions {
  std::string input, out;
  std::optional<int> runs;
  std::optional<int64_t> seed;
  bool no_images = false;
  int realisations = AcceptanceTask().realisations;
  WorkerSessionOptions worker;
};

// The inspection without fields that depend on the part.
v1::Inspection WithoutPart(v1::Inspection message) {
  message.clear_obstacles();
  message.clear_tolerances();
  message.clear_goal();
  message.clear_effects();
  message.mutable_rig()->clear_robot();
  message.mutable_rig()->clear_table();
  message.mutable_rig()->set_part_holding(v1::Rig::PART_HOLDING_FREE);
  return message;
}

// The artefacts' material as the only one; matt if the inspection states none.
void SetMaterial(const v1::Acceptance& acceptance, v1::Inspection* message) {
  message->clear_materials();
  v1::MaterialAssignment* assignment = message->add_materials();
  if (acceptance.has_material()) {
    *assignment->mutable_material() = acceptance.material();
    return;
  }
  assignment->mutable_material()->set_name("matt artefact");
  assignment->mutable_material()->mutable_lambert()->set_diffuse_albedo(0.5);
}

// Unset: the inspection has no sensor or lens, so that there are no images.
absl::StatusOr<std::optional<ArtefactImaging>> ImagingOf(const v1::Inspection& message,
                                                         const AcceptanceTask& task,
                                                         const std::string& folder) {
  const std::optional<ArtefactImaging> none;
  if (!task.inspection.sensor || !task.inspection.rig.lens) return none;
  v1::Inspection sent = WithoutPart(message);
  sent.clear_acceptance();
  const std::string mesh_file = folder + "/part.stl";
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(mesh_file, MeshOfArtefact(MakePlate(0.1)).stl));
  sent.mutable_part()->set_file(mesh_file);
  sent.mutable_part()->set_unit("m");
  SetMaterial(message.acceptance(), &sent);
  SIGHTLINE_ASSIGN_OR_RETURN(auto checked, CheckImagingInspection(sent, task.context));
  ArtefactImaging imaging;
  imaging.message = std::move(checked.message);
  SIGHTLINE_RETURN_IF_ERROR(TakeAssets(task.context, &imaging.message, &imaging.assets));
  // Every artefact has its own mesh.
  std::erase_if(imaging.assets, [&](const AssetFile& asset) {
    return asset.file == imaging.message.part().file();
  });
  // A single convex surface has no interreflection; a bore has, but it is ignored by default.
  if (!imaging.message.render().has_max_bounces()) {
    imaging.message.mutable_render()->set_max_bounces(1);
  }
  imaging.inspection = std::move(checked.inspection);
  imaging.place = PlaceOfSensors(task.settings, task.inspection.domain);
  imaging.folder = folder;
  imaging.seed = task.settings.seed;
  return std::optional(std::move(imaging));
}

void PrintResult(const v1::AcceptanceResult& result) {
  PrintText("%-24s  %-34s  %10s  %10s  %10s  %s\n", "quantity", "artefact", "simulated",
            "predicted", "permitted", "um");
  for (const v1::AcceptanceQuantity& q : result.quantities()) {
    PrintText("%-24s  %-34s  %10.1f  %10.1f  %10s  %s\n", q.quantity().c_str(),
              q.artefact().c_str(), 1e6 * q.simulated_m(), 1e6 * q.predicted_m(),
              q.has_permitted_m() ? absl::StrCat(1e6 * q.permitted_m()).c_str() : "-",
              !q.has_passed() ? ""
              : q.passed()    ? "passes"
                              : "fails");
  }
  for (const std::string& warning : result.warnings()) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
}

absl::Status WriteResult(const v1::AcceptanceResult& result, const std::string& out) {
  const std::string json = (fs::path(out) / "acceptance.json").string();
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(json, ToJson(result) + "\n"));
  return WriteReport(AcceptanceReport(result), (fs::path(out) / "report.html").string());
}

absl::StatusOr<int> Accept(const AcceptOptions& options) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(options.input, &message));
  if (options.runs) message.mutable_acceptance()->set_runs(*options.runs);
  if (options.seed) message.mutable_acceptance()->set_seed(*options.seed);
  AcceptanceTask task;
  task.context = options.input;
  task.realisations = options.realisations;
  SIGHTLINE_ASSIGN_OR_RETURN(task.settings, ParseAcceptance(message.acceptance(), options.input));
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto inspection,
      ParseInspection(message, options.input, fs::path(options.input).parent_path().string()));
  DeriveLimits(&inspection);
  task.inspection = std::move(inspection);
  task.detection_stated = message.uncertainty().has_line_detection();

  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.out));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto folder,
                             ProcessFolder::Make(TemporaryBase(), "sightline-accept"));
  ProgressLine progress;
  RenderClientOptions client;
  std::unique_ptr<EmbeddedServer> server;
  if (!options.no_images) {
    SIGHTLINE_ASSIGN_OR_RETURN(task.imaging, ImagingOf(message, task, folder.path()));
  }
  if (task.imaging) {
    SIGHTLINE_ASSIGN_OR_RETURN(server, StartWorkerSession(options.worker, &progress, &client));
  }
  auto result = RunAcceptance(task, client);
  progress.Finish();
  if (!result.ok()) return AboutInput(result.status(), options.input);
  result->set_sightline_version(SIGHTLINE_VERSION);
  PrintResult(*result);
  SIGHTLINE_RETURN_IF_ERROR(WriteResult(*result, options.out));
  for (const char* file : {"acceptance.json", "report.html", "report.json"}) {
    PrintText("%s\n", fs::absolute(fs::path(options.out) / file).c_str());
  }
  return kExitDone;
}

}  // namespace

Command AddAcceptCommand(CLI::App& app) {
  auto options = std::make_shared<AcceptOptions>();
  app.add_option("input", options->input, "inspection.json")->required();
  app.add_option("--out", options->out, "folder for acceptance.json, report.html and report.json")
      ->required();
  app.add_option("--runs", options->runs,
                 "simulated tests of every artefact, instead of the inspection's; default 200");
  app.add_option("--seed", options->seed, "of all draws and images; default 1");
  app.add_flag("--no-images", options->no_images,
               "draw detection errors from uncertainty.line_detection, render nothing");
  app.add_option("--realisations", options->realisations,
                 "images of every rendered frame, each with other speckle and noise; default 4")
      ->check(CLI::Range(1, 1000));
  AddWorkerOptions(app, &options->worker);
  TakeSizes(*app.add_option("--max-image-bytes", options->worker.max_image_bytes,
                            "memory of the embedded worker for one image, e.g. 16GB; default 8GB"));
  return [options]() -> int {
    const absl::StatusOr<int> code = Accept(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
