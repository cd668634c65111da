// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/command_options/option_values.h"
#include "core/file/atomic_write.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/frame_choice.h"
#include "planner_client/commands/optics/device_choice.h"
#include "planner_client/commands/optics/optics_outputs.h"
#include "planner_client/commands/optics/optics_request.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/commands/planning/document/plan_document.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/optics_client/optics_client.h"
#include "planner_client/optics_client/uncertainty_correction.h"
#include "planning/plan_file/plan_file.h"
#include "report/document/report_page.h"
#include "report/optics/optics_report.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct OpticsOptions {
  FrameChoice choice;
  std::string verification, catalogue;
  DeviceRequirements devices;
  bool common = false;
  std::optional<int64_t> seed;
  WorkerSessionOptions worker;
};

// "red": the channel that the line is detected in.
std::string DetectedChannel(const Inspection& inspection) {
  const Sensor& sensor = *inspection.sensor;
  if (sensor.colour_filter == ColourFilter::kMono) return "mono";
  const int best = inspection.optics->detector.channel.value_or(
      MostSensitiveChannel(sensor, inspection.rig.laser.wavelength_m));
  return best == kRed ? "red" : best == kGreen ? "green" : "blue";
}

// Before those of the render worker.
void PutWarningsFirst(const std::vector<std::string>& first, v1::OpticsPlan* optics) {
  const std::vector<std::string> others(optics->warnings().begin(), optics->warnings().end());
  optics->clear_warnings();
  for (const std::string& warning : first) optics->add_warnings(warning);
  for (const std::string& warning : others) optics->add_warnings(warning);
}

void Print(const v1::OpticsPlan& optics) {
  PrintText("%s\n", optics.common().statement().c_str());
  PrintText("\nf-number  exposure ms   u_px  coverage   cost  as good as the best\n");
  for (const v1::OpticsPoint& point : optics.curve()) {
    PrintText("%8s  %11s  %5.3f  %7.1f%%  %5.3f  %s\n",
              absl::StrFormat("%.3g", point.f_number()).c_str(),
              absl::StrFormat("%.4g", 1e3 * point.exposure_time_s()).c_str(), point.u_px(),
              100 * point.profile_coverage(), point.cost(), point.as_good_as_best() ? "yes" : "");
  }
  if (optics.scans_size() > 1) {
    PrintText("\nscan  f-number  exposure ms   u_px  coverage   cost\n");
    for (const v1::OpticsChoice& scan : optics.scans()) {
      const v1::OpticsPoint& point = scan.best();
      PrintText("%4d  %8s  %11s  %5.3f  %7.1f%%  %5.3f\n", scan.scan(),
                absl::StrFormat("%.3g", point.f_number()).c_str(),
                absl::StrFormat("%.4g", 1e3 * point.exposure_time_s()).c_str(), point.u_px(),
                100 * point.profile_coverage(), point.cost());
    }
  }
  PrintText("\n");
}

absl::StatusOr<int> Optics(const OpticsOptions& options) {
  const std::string& input = options.choice.input;
  SIGHTLINE_ASSIGN_OR_RETURN(auto made_request, MakeOpticsRequest(options.choice));
  const Inspection& inspection = made_request.inspection;
  v1::CreateOpticsRequest& request = made_request.request;
  if (options.seed) request.set_seed(*options.seed);
  request.set_per_scan(!options.common);
  std::optional<VerifiedCorrection> correction;
  if (!options.verification.empty()) {
    v1::Verification verification;
    SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(options.verification, &verification));
    SIGHTLINE_ASSIGN_OR_RETURN(correction, MakeCorrection(verification, DetectedChannel(inspection),
                                                          options.verification));
  }
  std::optional<DeviceCandidates> candidates;
  if (!options.catalogue.empty()) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        candidates, FindDevices(options.catalogue, inspection, request, options.devices));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.choice.out));

  ProgressLine progress;
  WorkerClientOptions client;
  SIGHTLINE_ASSIGN_OR_RETURN(auto worker, StartWorkerSession(options.worker, &progress, &client));
  std::optional<v1::DeviceChoice> devices;
  if (candidates) {
    auto chosen = ChooseDevices(*candidates, client, request, made_request.assets);
    if (!chosen.ok()) {
      progress.Finish();
      return AboutInput(chosen.status(), input);
    }
    devices = chosen->choice;
    *request.mutable_inspection() = chosen->inspection;
  }
  auto optics = PlanOptics(client, request, made_request.assets);
  progress.Finish();
  if (!optics.ok()) return AboutInput(optics.status(), input);
  optics->set_sightline_version(SIGHTLINE_VERSION);
  PutWarningsFirst(made_request.remarks, &*optics);
  if (correction) ApplyCorrection(*correction, &*optics);

  Print(*optics);
  for (const std::string& warning : optics->warnings()) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
  const fs::path out = options.choice.out;
  std::vector<std::string> files;
  const std::string answer = (out / "optics.json").string();
  SIGHTLINE_RETURN_IF_ERROR(WriteOpticsJson(*optics, answer));
  files.push_back(answer);
  if (devices) {
    const std::string file = (out / "devices.json").string();
    SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(file, ToJson(*devices) + "\n"));
    files.push_back(file);
  }
  if (!options.choice.plan.empty() && !options.choice.scan) {
    const std::string file = (out / "plan.json").string();
    GivenPlans known;  // compared with the part where its frames were chosen
    SIGHTLINE_ASSIGN_OR_RETURN(auto plan, ReadPlanScans(options.choice.plan, &known));
    SetSettings(*optics, &plan.plan);
    SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(file, ToJson(plan.plan) + "\n"));
    files.push_back(file);
  }
  const std::string report = (out / "report.html").string();
  SIGHTLINE_RETURN_IF_ERROR(WriteOpticsReport(*optics, devices ? &*devices : nullptr, report));
  files.push_back(report);
  files.push_back(ReportDataPath(report));
  for (const std::string& file : files) PrintText("%s\n", fs::absolute(file).c_str());
  return kExitDone;
}

}  // namespace

Command AddOpticsCommand(CLI::App& app) {
  auto options = std::make_shared<OpticsOptions>();
  app.add_option("input", options->choice.input, "inspection.json")->required();
  app.add_option("--out", options->choice.out, "folder for optics.json and report.html")
      ->required();
  AddFrameOptions(app, &options->choice);
  app.add_flag("--common", options->common,
               "with --plan: one setting for all scans, none for each alone");
  app.add_option("--verification", options->verification,
                 "verification.json of `sightline verify`: what u_px to expect of the real camera");
  app.add_option("--catalogue", options->catalogue,
                 "folder of cameras/, lenses/ and lasers/ to choose from");
  AddDeviceOptions(app, &options->devices);
  NeedOption(app, {"--max-footprint", "--min-view", "--min-depth", "--max-price", "--rendered"},
             "--catalogue");
  app.add_option("--seed", options->seed, "of simulated speckle, photons and noise; default 1");
  AddWorkerOptions(app, &options->worker);
  TakeSizes(*app.add_option("--max-image-bytes", options->worker.max_image_bytes,
                            "memory of the embedded worker for one image, e.g. 16GB; default 8GB"));
  return [options]() -> int {
    const absl::StatusOr<int> code = Optics(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
