// SPDX-License-Identifier: Apache-2.0
// The render worker of a command: an embedded or a remote one.
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
  std::string address;  // empty: an embedded worker
  int threads = 0;      // of the embedded worker; 0: one per core
  std::string max_image_bytes;
  ServerTlsOptions tls;  // of the worker at `address`
};

// --render-worker, --threads and TLS.
void AddWorkerOptions(CLI::App& app, WorkerSessionOptions* options);

// Starts a worker if no address is given and fills in access, progress and interrupt of `client`.
// `client` must not outlive `progress` (null: no progress) and the returned server (null: the
// worker is remote).
absl::StatusOr<std::unique_ptr<EmbeddedServer>> StartWorkerSession(
    const WorkerSessionOptions& options, ProgressLine* progress, WorkerClientOptions* client);

// Adds the name of `input` to an error of the worker. The code means wrong input if the request
// cannot be carried out.
absl::Status AboutInput(const absl::Status& status, const std::string& input);

}  // namespace sightline
