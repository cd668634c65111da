// SPDX-License-Identifier: Apache-2.0
// Takes connections on a TCP address and has the requests on them answered, a thread each.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/http/browser_guard.h"
#include "planning_service/http/http_exchange.h"
#include "planning_service/http/listening_socket.h"
#include "planning_service/http/tls_server_context.h"

namespace sightline {

struct HttpServerOptions {
  std::string option = "--http";  // name of `listen` in messages
  std::string listen;             // HOST:PORT, [IPv6]:PORT; port 0: any free one
  TlsFiles tls;                   // no certificate: plain
  absl::Duration tls_check_interval = absl::Seconds(2);
  // Limit for one peer, an address with any port; all clients behind a proxy are one. At least 1.
  // All peers together have twice as many, so that one leaves half to the others. Others get 503.
  int max_connections = 128;
  int64_t max_request_bytes = 0;
  // Longest time in which a peer neither sends nor takes anything, and in which the head of a
  // request must be complete; in (0, 24 h].
  absl::Duration request_timeout = absl::Seconds(30);
  // How long a new connection may take to agree on TLS, and then to begin its first request; at
  // most request_timeout counts. Positive.
  absl::Duration first_request_timeout = absl::Seconds(10);
};

class HttpServer {
 public:
  using Handler = std::function<void(HttpExchange&)>;

  // Listens; connections wait until Start(). INVALID_ARGUMENT names an option or TLS file that
  // cannot be used; UNAVAILABLE: the address is taken.
  static absl::StatusOr<std::unique_ptr<HttpServer>> Listen(const HttpServerOptions& options);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  const ListeningSocket& listening() const;
  // `handle` is called by several threads at a time, answers every request and must stay valid
  // until Stop() returns. To be called once.
  void Start(Handler handle);
  // Takes no new requests and lets running ones finish within 10 s; then cuts them off.
  // Idempotent, not thread-safe.
  void Stop();

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Refuses requests of other sites' pages. `names`: of this server, beside localhost and the address
// it listens on; checked if that is a loopback address or the list is not empty.
BrowserGuard MakeBrowserGuard(std::vector<std::string> names, const ListeningSocket& socket);

}  // namespace sightline
