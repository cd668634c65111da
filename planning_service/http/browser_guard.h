// SPDX-License-Identifier: Apache-2.0
// Protects the server from pages of other sites in a browser that can reach it (DNS rebinding and
// cross-site requests).
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "planning_service/http/http_exchange.h"

namespace sightline {

class BrowserGuard {
 public:
  // `names`: names of this server, without port. Empty: the Host of requests is not checked.
  explicit BrowserGuard(std::vector<std::string> names);

  // PERMISSION_DENIED, reason HOST_NOT_ALLOWED: the request names another host, whose owner may
  // have let that name point to this server. Reason ORIGIN_NOT_ALLOWED: the request would change
  // something and comes from a page of another origin.
  absl::Status Check(const HttpRequest& request) const;

 private:
  std::vector<std::string> names_;
};

}  // namespace sightline
