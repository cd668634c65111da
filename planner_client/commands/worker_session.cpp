// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/worker_session.h"

#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/status/status_macros.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/interrupt.h"
#include "proto/status/rpc_status.h"

namespace sightline {

void AddWorkerOptions(CLI::App& app, WorkerSessionOptions* options) {
  app.add_option("--render-worker,--server", options->address,
                 "unix:PATH or HOST:PORT; default: an embedded server");
  app.add_option("--threads", options->threads, "threads of the embedded worker; 0: one per core")
      ->check(CLI::Range(0, 1024));
  AddServerTlsOptions(app, &options->tls);
}

absl::StatusOr<std::unique_ptr<EmbeddedServer>> StartWorkerSession(
    const WorkerSessionOptions& options, ProgressLine* progress, WorkerClientOptions* client) {
  client->address = options.address;
  client->interrupted = &InterruptFlag();
  if (progress != nullptr) {
    client->on_progress = [progress](double fraction, const std::string& message) {
      progress->Show(fraction, message);
    };
  }
  SIGHTLINE_RETURN_IF_ERROR(UseServerTls(options.tls, !options.address.empty(), client));
  if (!options.address.empty()) {
    if (options.threads == 0 && options.max_image_bytes.empty()) return nullptr;
    return absl::InvalidArgumentError(
        "--threads and --max-image-bytes set up an embedded worker; start the worker of "
        "--render-worker with them");
  }
  EmbeddedServerOptions embedded;
  embedded.program = "render_worker";
  embedded.description = "render worker";
  embedded.arguments = {"--spool", "{folder}", "--threads", absl::StrCat(options.threads)};
  embedded.interrupted = &InterruptFlag();
  if (!options.max_image_bytes.empty()) {
    embedded.arguments.insert(embedded.arguments.end(),
                              {"--max-image-bytes", options.max_image_bytes});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto worker, EmbeddedServer::Start(std::move(embedded)));
  client->embedded = worker.get();
  return worker;
}

absl::Status AboutInput(const absl::Status& status, const std::string& input) {
  // The worker has lost the job.
  static const std::set<std::string> lost = {"JOB_UNKNOWN", "RESULT_DROPPED"};
  const std::string reason = ErrorReason(status);
  if (lost.count(reason) > 0) return absl::InternalError(status.message());
  const bool wrong_input = IsRefusedInput(status) || absl::IsFailedPrecondition(status);
  if (!wrong_input) return status;
  std::string message(status.message());
  if (const std::vector<FieldViolation> violations = FieldViolations(status);
      violations.size() > 1) {
    message.clear();
    for (const FieldViolation& v : violations) {
      absl::StrAppend(&message, message.empty() ? "" : "\n  ", v.field, ": ", v.description);
    }
  }
  // Fields of the request that people do not know.
  message = absl::StrReplaceAll(
      message, {{"source.images: ", ""}, {"source.recordings: ", ""}, {"source.recordings.", ""}});
  const std::string of_input = absl::StrCat(input, ": ");
  if (!absl::StartsWith(message, of_input)) message.insert(0, of_input);
  return absl::InvalidArgumentError(message);
}

}  // namespace sightline
