// SPDX-License-Identifier: Apache-2.0
// The HTTP front end of the planning service: jobs, results, events and the web page.
//
// The contract is openapi.json beside this file, served at /v1/openapi.json.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/access/client_access.h"
#include "planning_service/jobs/planning_jobs.h"

namespace sightline {

// A file of the web page.
struct WebFile {
  std::string path;  // of the URL: "/" or "/assets/page.js"
  std::string content_type;
  std::string bytes;
};

struct HttpApiOptions {
  std::string listen;  // HOST:PORT, [IPv6]:PORT; port 0: any free one
  // PEM files. Certificate and key turn on TLS. With a client CA, clients need a certificate of it.
  // New contents of the files count for new connections; if they are unusable, the service logs a
  // warning and keeps the old ones.
  std::string tls_certificate_file;
  std::string tls_key_file;
  std::string tls_client_ca_file;
  absl::Duration tls_check_interval = absl::Seconds(2);
  // Limits on the connections of one address and the event streams of one client, at least 1. All
  // addresses or clients together may have twice as many. An event stream is also a connection.
  // Connections and streams above a limit get 503.
  int max_connections = 128;
  int max_event_streams = 64;
  int64_t max_request_bytes = int64_t{4} << 30;
  // Memory of all JSON bodies that are being read and of their messages; one client may hold half
  // of it. Bodies above a limit get 503. With at least 256 MiB, the largest body (16 MiB) is
  // accepted while others are read.
  int64_t max_body_memory_bytes = int64_t{256} << 20;
  // Longest time for which a peer may neither send nor receive, and for the head of a request to be
  // complete; in (0, 24 h]. After this time, bodies slower than 4 KiB/s on average are cut off.
  absl::Duration request_timeout = absl::Seconds(30);
  // Names of this server in requests, in addition to localhost and the address it listens on. They
  // are checked if that is a loopback address or the list is not empty.
  std::vector<std::string> allowed_hosts;
  std::vector<WebFile> web_files;
};

class HttpApi {
 public:
  // Both pointers must outlive it. INVALID_ARGUMENT for an option or TLS file that cannot be used,
  // naming it; UNAVAILABLE when the address is taken.
  static absl::StatusOr<std::unique_ptr<HttpApi>> Start(const HttpApiOptions& options,
                                                        PlanningJobs* jobs, ClientAccess* access);
  ~HttpApi();
  HttpApi(const HttpApi&) = delete;
  HttpApi& operator=(const HttpApi&) = delete;

  // HOST:PORT with the actual port.
  const std::string& address() const;
  // Accepts no new requests, ends event streams, and lets running requests finish within 10 s, then
  // cuts them off. Idempotent, not thread-safe.
  void Stop();

 private:
  struct Impl;
  explicit HttpApi(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
