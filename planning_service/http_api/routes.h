// SPDX-License-Identifier: Apache-2.0
// Handlers of each path and method of the HTTP front end.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/admission/shared_limit.h"
#include "planning_service/access/client_access.h"
#include "planning_service/http/browser_guard.h"
#include "planning_service/http/http_exchange.h"
#include "planning_service/http_api/http_api.h"
#include "planning_service/jobs/planning_jobs.h"

namespace sightline {

// Thread-safe.
class Routes {
 public:
  // Pointers must outlive it.
  Routes(PlanningJobs* jobs, ClientAccess* access, BrowserGuard guard, int max_event_streams,
         int64_t max_body_memory_bytes, const std::vector<WebFile>& web_files);

  // Answers the request.
  void Answer(HttpExchange& exchange);

 private:
  using Path = std::vector<std::string>;
  using Handler = void (Routes::*)(HttpExchange&, const Client&, const Path&);
  struct Route {
    const char* method;
    Path pattern;  // "*": one segment, "**" at the end: one or more
    Handler handler;
  };
  struct WebReply {
    WebFile file;
    std::string entity_tag;
  };

  static bool Matches(const Path& pattern, const Path& path);
  // Calls the handler. If memory runs out, the answer is 503, because a later try may succeed.
  void Handle(const Route& route, HttpExchange& exchange, const Client& client);
  bool AnswerWebFile(HttpExchange& exchange);

  void CreateJob(HttpExchange& exchange, const Client& client, const Path& path);
  void ListJobs(HttpExchange& exchange, const Client& client, const Path& path);
  void GetJob(HttpExchange& exchange, const Client& client, const Path& path);
  void CancelJob(HttpExchange& exchange, const Client& client, const Path& path);
  void WatchJob(HttpExchange& exchange, const Client& client, const Path& path);
  void ListResults(HttpExchange& exchange, const Client& client, const Path& path);
  void GetResult(HttpExchange& exchange, const Client& client, const Path& path);
  void PutFile(HttpExchange& exchange, const Client& client, const Path& path);
  void PutRecipe(HttpExchange& exchange, const Client& client, const Path& path);
  void DeleteRecipe(HttpExchange& exchange, const Client& client, const Path& path);
  void StartRecipe(HttpExchange& exchange, const Client& client, const Path& path);
  void GetState(HttpExchange& exchange, const Client& client, const Path& path);

  PlanningJobs* const jobs_;
  ClientAccess* const access_;
  const BrowserGuard guard_;
  // Event streams: one client may open half of them, so that the other half is left to others.
  const SharedLimit event_streams_;
  // Memory of JSON bodies and of their messages [bytes]: one client may hold half of it.
  const SharedLimit body_memory_;
  const std::string openapi_;
  const std::vector<Route> routes_;
  std::map<std::string, WebReply> web_files_;  // by path
};

}  // namespace sightline
