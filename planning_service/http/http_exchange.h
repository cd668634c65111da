// SPDX-License-Identifier: Apache-2.0
// A request and its answer, as the routes see them.
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
  // By lower-case names; several of a name are joined by ", ".
  std::map<std::string, std::string> headers;
  PeerCredentials peer;

  // Empty if there is none.
  std::string Header(const std::string& lower_case_name) const {
    const auto entry = headers.find(lower_case_name);
    return entry == headers.end() ? "" : entry->second;
  }
};

using HttpHeaders = std::vector<std::pair<std::string, std::string>>;

// For one thread. Answers are begun once; after an error of Begin or Write the connection is lost
// and nothing more can be said.
class HttpExchange {
 public:
  virtual ~HttpExchange() = default;
  virtual const HttpRequest& request() const = 0;

  // Next piece of the request's body, at most 64 KiB; empty at its end. CANCELLED: the client has
  // gone; DEADLINE_EXCEEDED, reason REQUEST_TIMEOUT; RESOURCE_EXHAUSTED, reason REQUEST_TOO_LARGE;
  // INVALID_ARGUMENT: broken framing.
  virtual absl::StatusOr<std::string> ReadBody() = 0;

  // Status line and headers. Without `content_length` the body is sent in chunks.
  virtual absl::Status Begin(int http_status, const HttpHeaders& headers,
                             std::optional<int64_t> content_length) = 0;
  // A piece of the body. Nothing is sent in answer to HEAD.
  virtual absl::Status Write(absl::string_view bytes) = 0;
  // The answer is complete.
  virtual absl::Status End() = 0;
  virtual bool has_begun() const = 0;

  // Whether the client is there and the server is not ending.
  virtual bool IsWanted() const = 0;
};

}  // namespace sightline
