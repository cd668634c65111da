// SPDX-License-Identifier: Apache-2.0
// Interface for the routes: a request and its answer.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "planning_service/access/client_access.h"
#include "planning_service/http/request_target.h"

namespace sightline {

struct HttpRequest {
  std::string method;
  std::string target;  // as sent, for the log
  RequestTarget url;
  // Values by lower-case names; several headers of one name are joined by ", ".
  std::map<std::string, std::string> headers;
  PeerCredentials peer;

  // Value of a header; empty if there is none.
  std::string Header(const std::string& lower_case_name) const {
    const auto entry = headers.find(lower_case_name);
    return entry == headers.end() ? "" : entry->second;
  }
};

using HttpHeaders = std::vector<std::pair<std::string, std::string>>;

// For one thread. An answer is begun once. After an error of Begin or Write the connection is lost,
// and no answer can be sent any more.
class HttpExchange {
 public:
  virtual ~HttpExchange() = default;
  virtual const HttpRequest& request() const = 0;

  // Next piece of the request's body, at most 64 KiB; empty at its end. CANCELLED: the client has
  // gone; DEADLINE_EXCEEDED, reason REQUEST_TIMEOUT; RESOURCE_EXHAUSTED, reason REQUEST_TOO_LARGE;
  // INVALID_ARGUMENT: broken framing.
  virtual absl::StatusOr<std::string> ReadBody() = 0;

  // Sends status line and headers. Without `content_length` the body is sent in chunks.
  virtual absl::Status Begin(int http_status, const HttpHeaders& headers,
                             std::optional<int64_t> content_length) = 0;
  // Sends a piece of the body; sends nothing in answer to HEAD.
  virtual absl::Status Write(absl::string_view bytes) = 0;
  // Completes the answer.
  virtual absl::Status End() = 0;
  virtual bool has_begun() const = 0;

  // False once the client is gone or the server ends.
  virtual bool IsWanted() const = 0;
};

}  // namespace sightline
