// SPDX-License-Identifier: Apache-2.0
// A running coverage server: gRPC services, health, reflection, metrics.
#pragma once

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "coverage_server/service/coverage_backend.h"
#include "rpc_server/rpc_server.h"

namespace sightline {

struct CoverageServerOptions : RpcServerOptions {
  int threads = 0;        // queries at a time; 0: one per core
  int scene_workers = 1;  // scenes built at a time; each uses all cores
  int64_t max_part_file_bytes = int64_t{512} << 20;
  int64_t max_part_store_bytes = int64_t{1} << 30;
  int64_t max_scene_bytes = int64_t{4} << 30;
};

// Serves from Start until Drain or the destructor.
class CoverageServer : public RunningServer {
 public:
  // INVALID_ARGUMENT for an address or TLS file that cannot be used, naming it; UNAVAILABLE when
  // the address is taken.
  static absl::StatusOr<std::unique_ptr<CoverageServer>> Start(const CoverageServerOptions& options,
                                                               const CoverageBackend& backend);
  // 0 if metrics are off.
  virtual int metrics_port() const = 0;
};

}  // namespace sightline
