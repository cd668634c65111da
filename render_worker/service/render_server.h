// SPDX-License-Identifier: Apache-2.0
// A running render worker: gRPC services, health, reflection, metrics.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "render_worker/service/diagnosis_service.h"
#include "rpc_server/rpc_server.h"

namespace sightline {

struct RenderServerOptions : RpcServerOptions {
  int threads = 0;         // of one job; 0: one per core
  int render_workers = 1;  // concurrent jobs
  // Limits of all waiting and running jobs: their number, and the memory of their requests. Jobs
  // beyond them get RESOURCE_EXHAUSTED.
  int64_t max_queued_jobs = 64;
  int64_t max_queued_bytes = int64_t{256} << 20;
  // Folder for assets and images; empty: the system's temporary folder. The server makes a
  // subfolder that only its user can enter and removes it when it ends. If the server is killed,
  // the next one that starts on the same folder removes it.
  std::string spool_folder;
  // Maximum age of unused uploaded files, and of images after the end of their job.
  absl::Duration keep = absl::Hours(24);
  int64_t max_asset_bytes = int64_t{512} << 20;
  int64_t max_asset_store_bytes = int64_t{4} << 30;
  int64_t max_output_bytes = int64_t{16} << 30;
  int64_t max_image_bytes = int64_t{8} << 30;
  int64_t max_set_bytes = int64_t{1} << 30;
};

// Serves from Start until Drain or destruction.
class RenderServer : public RunningServer {
 public:
  // INVALID_ARGUMENT names an unusable address, folder or TLS file; UNAVAILABLE if the address is
  // in use. `functions`: for the DiagnosisService.
  static absl::StatusOr<std::unique_ptr<RenderServer>> Start(const RenderServerOptions& options,
                                                             RecordingFunctions functions = {});
  // 0 if metrics are off.
  virtual int metrics_port() const = 0;
};

}  // namespace sightline
