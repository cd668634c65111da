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
  int render_workers = 1;  // jobs at a time
  // Limits on all jobs that wait or run: how many, and memory of their requests. More get
  // RESOURCE_EXHAUSTED.
  int64_t max_queued_jobs = 64;
  int64_t max_queued_bytes = int64_t{256} << 20;
  // Folder for assets and images; empty: the system's temporary folder. The server makes a
  // folder there that only its user can enter. It goes when the server ends; if it is killed, when
  // the next one starts on the same folder.
  std::string spool_folder;
  // How long uploaded files stay that no request uses, and images whose job has ended.
  absl::Duration keep = absl::Hours(24);
  int64_t max_asset_bytes = int64_t{512} << 20;
  int64_t max_asset_store_bytes = int64_t{4} << 30;
  int64_t max_output_bytes = int64_t{16} << 30;
  int64_t max_image_bytes = int64_t{8} << 30;
  int64_t max_set_bytes = int64_t{1} << 30;
};

// Serves from Start until Drain or the destructor.
class RenderServer : public RunningServer {
 public:
  // INVALID_ARGUMENT for an address, folder or TLS file that cannot be used, naming it; UNAVAILABLE
  // when the address is taken. `functions`: of the DiagnosisService.
  static absl::StatusOr<std::unique_ptr<RenderServer>> Start(const RenderServerOptions& options,
                                                             RecordingFunctions functions = {});
  // 0 if metrics are off.
  virtual int metrics_port() const = 0;
};

}  // namespace sightline
