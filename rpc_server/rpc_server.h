// SPDX-License-Identifier: Apache-2.0
// Common parts of every server: address, TLS, health, reflection, metrics, drain.
#pragma once

#include <grpcpp/impl/service_type.h>

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "core/job/job_store.h"
#include "rpc_server/call_tracker.h"
#include "rpc_server/job_service.h"
#include "rpc_server/server_metrics.h"

namespace grpc {
class Server;
}
namespace prometheus {
class Exposer;
}

namespace sightline {

// Largest message either end accepts. Chunks of streams stay below 1 MiB.
inline constexpr int kMaxMessageBytes = 64 << 20;

struct RpcServerOptions {
  // "unix:PATH" or "HOST:PORT"; port 0: any free one.
  std::string listen;
  int max_call_threads = 256;
  // Largest message that a client may send; larger ones are refused with RESOURCE_EXHAUSTED before
  // they are read.
  int max_request_bytes = kMaxMessageBytes;
  // Fraction of all calls and streams that one peer may have open, in (0, 1].
  double peer_share = 0.5;
  // How long a stream may wait for its client before it is ended.
  absl::Duration idle_timeout = absl::Seconds(60);
  // Prometheus: http://METRICS_HOST:METRICS_PORT/metrics; -1: off, 0: any free port.
  std::string metrics_host = "127.0.0.1";
  int metrics_port = -1;
  // Lets other machines reach the server without TLS, and its metrics, which never have TLS.
  bool allow_plaintext = false;
  // PEM files, see TlsFiles; they may be replaced while the server runs.
  std::string tls_certificate_file;
  std::string tls_key_file;
  std::string tls_client_ca_file;
};

// A server that runs until it is drained.
class RunningServer {
 public:
  virtual ~RunningServer() = default;
  // Address that clients connect to: "unix:PATH" or "HOST:PORT" with the actual port.
  virtual const std::string& address() const = 0;
  // Ends the server gracefully: health turns NOT_SERVING, new calls are refused with UNAVAILABLE,
  // watches end, jobs are cancelled. Running calls may finish within `grace` and are cancelled
  // afterwards. Returns true if all finished in time. The server answers health checks until it is
  // down.
  virtual bool Drain(absl::Duration grace) = 0;
  // Called when the process is about to end without waiting for Drain: removes files of the server
  // from disk as far as possible while it still runs.
  virtual void Abandon() {}
};

// Serves a JobService over `jobs` and the services of its owner; both must exist until Drain has
// returned. Null `jobs`: there is no JobService, and Drain cancels nothing.
class RpcServer : public RunningServer {
 public:
  struct NamedService {
    std::string name;  // for health checks, e.g. "sightline.v1.CoverageService"
    grpc::Service* service;
  };

  // `name`: name of the program, for logs. The pointers' targets must outlive the server.
  RpcServer(std::string name, ServerMetrics* metrics, CallTracker* calls, JobStore* jobs);
  ~RpcServer() override;

  // INVALID_ARGUMENT for an address or TLS file that cannot be used, naming it, and for plain text
  // on an address that other machines reach; UNAVAILABLE when the address is taken.
  absl::Status Listen(const RpcServerOptions& options, const std::vector<NamedService>& services);

  const std::string& address() const override { return address_; }
  // Port of the metrics; 0 if metrics are off.
  int metrics_port() const { return metrics_port_; }
  bool Drain(absl::Duration grace) override;

 private:
  const std::string name_;
  ServerMetrics* const metrics_;
  CallTracker* const calls_;
  JobStore* const jobs_;
  JobServiceImpl job_service_;
  std::unique_ptr<prometheus::Exposer> exposer_;
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
  int metrics_port_ = 0;
};

}  // namespace sightline
