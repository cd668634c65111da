// SPDX-License-Identifier: Apache-2.0
#include "planner_client/explore/explore_routes.h"

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/status/status_macros.h"
#include "planner_client/explore/explore_page.h"
#include "planning_service/http/http_reply.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// The page's own scripts and styles, and nothing from elsewhere.
constexpr char kPagePolicy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

// File names and messages from elsewhere may not be UTF-8; JSON must be.
std::string Text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

absl::StatusOr<Json> ReadJsonRequest(HttpExchange& exchange) {
  // Forms of other pages cannot send this type without a CORS preflight request.
  if (!absl::StartsWith(exchange.request().Header("content-type"), "application/json")) {
    return WithErrorInfo(absl::InvalidArgumentError("Content-Type must be application/json"),
                         "MEDIA_TYPE_NOT_SUPPORTED");
  }
  std::string body;
  while (true) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto piece, exchange.ReadBody());
    if (piece.empty()) return ParseRequestBody(body);
    absl::StrAppend(&body, piece);
  }
}

}  // namespace

ExploreRoutes::ExploreRoutes(ExploreSession* session, BrowserGuard guard)
    : guard_(std::move(guard)),
      gets_{{"/api/setup", [session] { return Text(session->Setup()); }},
            {"/api/scene", [session] { return session->Scene(); }},
            {"/api/state", [session] { return Text(session->State()); }},
            {"/api/suggestion", [session] { return Text(session->SuggestionProgress()); }}},
      posts_{{"/api/scan", [session](const Json& r) { return session->Evaluate(r); }},
             {"/api/admissible", [session](const Json& r) { return session->Admissible(r); }},
             {"/api/plan", [session](const Json& r) { return session->ChangePlan(r); }},
             {"/api/suggestion", [session](const Json& r) { return session->Suggest(r); }},
             {"/api/suggestion/cancel",
              [session](const Json&) -> absl::StatusOr<Json> {
                session->CancelSuggestion();
                return Json::object();
              }},
             {"/api/picture", [session](const Json& r) { return session->Picture(r); }},
             {"/api/save", [session](const Json& r) { return session->Save(r); }}} {}

bool ExploreRoutes::AnswerPageFile(HttpExchange& exchange, const std::string& path) const {
  for (const ExplorePageFile& file : ExplorePage()) {
    if (file.path != path) continue;
    HttpHeaders headers = {{"Cache-Control", "no-cache"}, {"X-Content-Type-Options", "nosniff"}};
    if (path == "/") headers.emplace_back("Content-Security-Policy", kPagePolicy);
    ReplyText(exchange, 200, headers, file.content_type,
              absl::string_view(file.bytes.data(), file.bytes.size()));
    return true;
  }
  return false;
}

void ExploreRoutes::Answer(HttpExchange& exchange) const {
  const HttpRequest& request = exchange.request();
  if (absl::Status status = guard_.Check(request); !status.ok()) {
    return ReplyError(exchange, status);
  }
  const std::string path = absl::StrCat("/", absl::StrJoin(request.url.path, "/"));
  const bool reads = request.method == "GET" || request.method == "HEAD";
  if (reads && AnswerPageFile(exchange, path)) return;
  const auto get = gets_.find(path);
  const auto post = posts_.find(path);
  if (reads && get != gets_.end()) return ReplyJson(exchange, 200, get->second());
  if (request.method == "POST" && post != posts_.end()) {
    auto body = ReadJsonRequest(exchange);
    if (!body.ok()) return ReplyError(exchange, body.status());
    const auto answer = post->second(*body);
    if (!answer.ok()) return ReplyError(exchange, answer.status());
    return ReplyJson(exchange, 200, Text(*answer));
  }
  if (get == gets_.end() && post == posts_.end()) {
    return ReplyError(exchange, WithErrorInfo(absl::NotFoundError("there is nothing at this path"),
                                              "PATH_UNKNOWN"));
  }
  ReplyError(exchange, WithErrorInfo(absl::UnimplementedError("this path has no such method"),
                                     "METHOD_NOT_ALLOWED"));
}

}  // namespace sightline
