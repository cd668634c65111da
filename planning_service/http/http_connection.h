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
  // How long a connection may be silent before its first request, if that is shorter.
  absl::Duration first_request_timeout = absl::Seconds(10);
};

// Answers requests until either side closes the connection. `handle` must begin and end an answer
// to each; it may leave the body unread.
void ServeHttpConnection(ConnectionStream* stream, const HttpConnectionLimits& limits,
                         const std::function<void(HttpExchange&)>& handle);

}  // namespace sightline
