// SPDX-License-Identifier: Apache-2.0
// Handlers of each path and method of the explorer's HTTP server.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <utility>

#include "planner_client/explore/explore_session.h"
#include "planning_service/http/browser_guard.h"
#include "planning_service/http/http_exchange.h"

namespace sightline {

// Largest body of a request: measurements and names are short.
inline constexpr int64_t kMaxExploreRequestBytes = 64 << 10;

// GET: the page at /, /api/setup, /api/scene, /api/state, /api/suggestion. POST with JSON:
// /api/scan, /api/plan, /api/suggestion, /api/suggestion/cancel, /api/picture, /api/save; see
// ExploreSession. Errors are JSON, as those of the planning service. Thread-safe.
class ExploreRoutes {
 public:
  // `session` must outlive it.
  ExploreRoutes(ExploreSession* session, BrowserGuard guard);

  // Answers the request.
  void Answer(HttpExchange& exchange) const;

 private:
  using Get = std::function<std::string()>;
  using Post = std::function<absl::StatusOr<Json>(const Json&)>;

  bool AnswerPageFile(HttpExchange& exchange, const std::string& path) const;

  const BrowserGuard guard_;
  const std::map<std::string, Get> gets_;
  const std::map<std::string, Post> posts_;
};

}  // namespace sightline
