// SPDX-License-Identifier: Apache-2.0
// The render worker of a command: one of our own, or one that runs elsewhere.
#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/server_tls.h"
#include "planner_client/embedded_server/embedded_server.h"
#include "planner_client/rpc_client/worker_call.h"

namespace sightline {

struct WorkerSessionOptions {
  std::string address;  // empty: one of our own
  int threads = 0;      // of our own; 0: one per core
  std::string max_image_bytes;
  ServerTlsOptions tls;  // of the worker at `address`
};

// --render-worker, --threads and TLS.
void AddWorkerOptions(CLI::App& app, WorkerSessionOptions* options);

// Starts a worker if none was given; fills access, progress and interrupt of `client`, which must
// not outlive `progress` (null: nothing is shown) and the returned server (null: the worker runs
// elsewhere).
absl::StatusOr<std::unique_ptr<EmbeddedServer>> StartWorkerSession(
    const WorkerSessionOptions& options, ProgressLine* progress, WorkerClientOptions* client);

// Adds the name of `input` to an error of the worker. The code says wrong input if the request
// cannot be carried out.
absl::Status AboutInput(const absl::Status& status, const std::string& input);

}  // namespace sightline
