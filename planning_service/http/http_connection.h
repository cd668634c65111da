// SPDX-License-Identifier: Apache-2.0
// HTTP/1.1 on one connection: framing by Boost.Beast, limits and deadlines here.
#pragma once

#include <cstdint>
#include <functional>

#include "absl/time/time.h"
#include "planning_service/http/connection_stream.h"
#include "planning_service/http/http_exchange.h"

namespace sightline {

struct HttpConnectionLimits {
  int64_t max_request_bytes = 0;
  absl::Duration request_timeout;
  // Longest time before the first request of a connection; the shorter of both timeouts counts.
  absl::Duration first_request_timeout = absl::Seconds(10);
};

// Serves requests until either side closes the connection. `handle` must begin and end an answer
// to every request; it may leave the body unread.
void ServeHttpConnection(ConnectionStream* stream, const HttpConnectionLimits& limits,
                         const std::function<void(HttpExchange&)>& handle);

}  // namespace sightline
