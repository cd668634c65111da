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
  // PEM files. Certificate and key: TLS; a client CA as well: clients must have a certificate of
  // it. New contents of the files are used for new connections; unusable ones leave the old in
  // place, with a warning in the log.
  std::string tls_certificate_file;
  std::string tls_key_file;
  std::string tls_client_ca_file;
  absl::Duration tls_check_interval = absl::Seconds(2);
  // Both at least 1: connections of one address, event streams of one client; together there may be
  // twice as many. Event streams are connections too; further ones get 503.
  int max_connections = 128;
  int max_event_streams = 64;
  int64_t max_request_bytes = int64_t{4} << 30;
  // Memory of all JSON bodies that are being read, and of their messages, at a time; half of it at
  // most for one client. Further ones get 503. At least 256 MiB lets the largest body, of 16 MiB,
  // in while others are read.
  int64_t max_body_memory_bytes = int64_t{256} << 20;
  // Longest time in which a peer neither sends nor takes anything, and in which the head of a
  // request must be complete; in (0, 24 h]. Bodies slower than 4 KiB/s on the whole are cut off
  // after it.
  absl::Duration request_timeout = absl::Seconds(30);
  // Names of this server in requests, beside localhost and the address it listens on. Checked if
  // it listens on a loopback address or the list is not empty.
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
  // Takes no new requests, ends event streams, and lets running requests finish within 10 s; then
  // cuts them off. Idempotent, not thread-safe.
  void Stop();

 private:
  struct Impl;
  explicit HttpApi(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace sightline
