// SPDX-License-Identifier: Apache-2.0
// Keeps pages of other sites, opened in a browser that reaches this server, from using it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "planning_service/http/http_exchange.h"

namespace sightline {

class BrowserGuard {
 public:
  // `names`: of this server, without port; empty: any (a request's Host is not checked).
  explicit BrowserGuard(std::vector<std::string> names);

  // PERMISSION_DENIED, reason HOST_NOT_ALLOWED: the request is for another name, as when that
  // name's owner lets it point here; ORIGIN_NOT_ALLOWED: it would change something and comes from a
  // page of another origin.
  absl::Status Check(const HttpRequest& request) const;

 private:
  std::vector<std::string> names_;
};

}  // namespace sightline
