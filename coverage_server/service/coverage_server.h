// A running coverage server: gRPC services, health, reflection, metrics.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "coverage_server/service/coverage_backend.h"

namespace sightline {

struct CoverageServerOptions {
  // "unix:PATH" or "HOST:PORT"; port 0: any free one.
  std::string listen;
  int threads = 0;        // queries at a time; 0: one per core
  int scene_workers = 1;  // scenes built at a time; each uses all cores
  int max_call_threads = 256;
  int64_t max_part_file_bytes = int64_t{512} << 20;
  int64_t max_part_store_bytes = int64_t{1} << 30;
  int64_t max_scene_bytes = int64_t{4} << 30;
  // Prometheus: http://METRICS_HOST:METRICS_PORT/metrics; -1: off, 0: any free port.
  std::string metrics_host = "0.0.0.0";
  int metrics_port = -1;
  // PEM files. Certificate and key: TLS; a client CA as well: clients must have a certificate of
  // it.
  std::string tls_certificate_file;
  std::string tls_key_file;
  std::string tls_client_ca_file;
};

// Serves from Start until Drain or the destructor.
class CoverageServer {
 public:
  // INVALID_ARGUMENT for an address or TLS file that cannot be used, naming it; UNAVAILABLE when
  // the address is taken.
  static absl::StatusOr<std::unique_ptr<CoverageServer>> Start(const CoverageServerOptions& options,
                                                               CoverageBackend backend);
  virtual ~CoverageServer() = default;

  // What clients connect to: "unix:PATH" or "HOST:PORT" with the actual port.
  virtual const std::string& address() const = 0;
  // 0 if metrics are off.
  virtual int metrics_port() const = 0;

  // Graceful end: health turns NOT_SERVING, new calls are refused with UNAVAILABLE, watches end,
  // scene jobs are cancelled; running calls may finish within `grace`, then they are cancelled too.
  // Returns true if all finished in time. The server still answers health checks meanwhile and is
  // down afterwards.
  virtual bool Drain(absl::Duration grace) = 0;
};

}  // namespace sightline
