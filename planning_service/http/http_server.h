// SPDX-License-Identifier: Apache-2.0
// Accepts connections on a TCP address and serves their requests, with one thread per connection.
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
  // Limit for one peer, at least 1. A peer is an address with any port; all clients behind a proxy
  // are one peer. All peers together may have twice as many. Connections above a limit get 503.
  int max_connections = 128;
  int64_t max_request_bytes = 0;
  // Longest time for which a peer may neither send nor receive, and for the head of a request to be
  // complete; in (0, 24 h].
  absl::Duration request_timeout = absl::Seconds(30);
  // Longest time of a new connection for its TLS handshake, and then until its first request
  // begins; at most request_timeout counts. Positive.
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
  // Starts to serve; to be called once. Several threads call `handle` at the same time; it must
  // answer every request and stay valid until Stop() returns.
  void Start(Handler handle);
  // Accepts no new requests and lets running ones finish within 10 s, then cuts them off.
  // Idempotent, not thread-safe.
  void Stop();

 private:
  struct Impl;
  explicit HttpServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// A guard against pages of other sites. `names`: names of this server in addition to localhost and
// its address. The Host is checked if the address is a loopback one or `names` is not empty.
BrowserGuard MakeBrowserGuard(std::vector<std::string> names, const ListeningSocket& socket);

}  // namespace sightline
