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
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/output_folder.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/worker_session.h"
#include "planner_client/diagnosis_client/diagnosis_client.h"
#include "planner_client/diagnosis_client/recorded_folder.h"
#include "planner_client/diagnosis_client/sensor_set_folder.h"
#include "planner_client/diagnosis_client/verification_csv.h"
#include "report/verification/verification_report.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

struct VerifyOptions {
  std::string input, out;
  std::optional<int64_t> seed;
  WorkerSessionOptions worker;
};

void Print(const v1::Verification& verification) {
  PrintText("%s\nchannel    mean e_i  largest e_i  mean e_u  largest e_u\n",
            verification.set().c_str());
  const auto text = [](bool given, double value) {
    return given ? absl::StrFormat("%.3f", value) : "-";
  };
  for (const v1::ChannelSummary& c : verification.summary()) {
    PrintText("%-9s %9s %12s %9s %12s\n", c.channel().c_str(),
              text(c.has_mean_e_i(), c.mean_e_i()).c_str(),
              text(c.has_largest_e_i(), c.largest_e_i()).c_str(),
              text(c.has_mean_e_u(), c.mean_e_u()).c_str(),
              text(c.has_largest_e_u(), c.largest_e_u()).c_str());
  }
  PrintText("\n");
}

absl::StatusOr<int> Verify(VerifyOptions options) {
  if (IsSensorSet(options.input)) {
    return absl::InvalidArgumentError(
        absl::StrCat(options.input,
                     ": has flat-field and dark frames of a camera (EMVA 1288), verify is for "
                     "recordings of a plate; use sightline diagnose"));
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto set, ReadRecordedFolder(options.input, Shown::kPlate));
  if (options.out.empty()) options.out = (fs::path(set.folder) / "verification").string();
  SIGHTLINE_ASSIGN_OR_RETURN(const auto out_lock, OpenOutputFolder(options.out));
  v1::CreateVerificationRequest request;
  *request.mutable_source()->mutable_recordings() = set.recordings;
  if (options.seed) request.set_seed(*options.seed);

  ProgressLine progress;
  WorkerClientOptions client;
  SIGHTLINE_ASSIGN_OR_RETURN(auto worker, StartWorkerSession(options.worker, &progress, &client));
  const auto verification = VerifyRecordings(client, std::move(request), set.images);
  progress.Finish();
  if (!verification.ok()) return AboutInput(verification.status(), set.description_file);

  Print(*verification);
  for (const std::string& warning : verification->warnings()) {
    PrintTextTo(stderr, "warning: %s\n", warning.c_str());
  }
  const fs::path out = options.out;
  const std::string report = (out / "report.html").string();
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically((out / "verification.json").string(), ToJson(*verification) + "\n"));
  SIGHTLINE_RETURN_IF_ERROR(
      WriteFileAtomically((out / "verification.csv").string(), VerificationCsv(*verification)));
  SIGHTLINE_RETURN_IF_ERROR(WriteVerificationReport(*verification, report));
  for (const char* file : {"report.html", "report.json", "verification.json", "verification.csv"}) {
    PrintText("%s\n", fs::absolute(out / file).c_str());
  }
  return kExitDone;
}

}  // namespace

Command AddVerifyCommand(CLI::App& app) {
  auto options = std::make_shared<VerifyOptions>();
  app.add_option("input", options->input, "folder of recordings of a plate, or its recordings.json")
      ->required();
  app.add_option("--out", options->out, "folder for the result; default: verification/ in the set");
  app.add_option("--seed", options->seed, "of simulated speckle, photons and noise; default 1");
  AddWorkerOptions(app, &options->worker);
  return [options]() -> int {
    const absl::StatusOr<int> code = Verify(*options);
    return code.ok() ? *code : ReportError(code.status());
  };
}

}  // namespace sightline
