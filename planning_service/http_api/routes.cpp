// SPDX-License-Identifier: Apache-2.0
#include "planning_service/http_api/routes.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <new>
#include <optional>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/digest/sha256.h"
#include "core/json/message_json.h"
#include "core/status/status_macros.h"
#include "planning_service/http/http_reply.h"
#include "planning_service/http_api/event_stream.h"
#include "planning_service/http_api/openapi.h"
#include "planning_service/http_api/request_body.h"
#include "planning_service/http_api/result_reply.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// Allows the page's own scripts, styles and pictures, and frames with reports; nothing else.
constexpr char kPagePolicy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "font-src 'self'; connect-src 'self'; frame-src 'self' blob:; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'";

std::string Location(const std::string& job_id) {
  return absl::StrCat("/v1/jobs/", PercentEncode(job_id, /*keep_slashes=*/false));
}

void ReplyNewJob(HttpExchange& exchange, const absl::StatusOr<PlanningJob>& job) {
  if (!job.ok()) return ReplyError(exchange, job.status());
  ReplyJson(exchange, 201, MessageJson(PlanningJobToProto(*job)),
            {{"Location", Location(job->job_id)}});
}

void ReplyJob(HttpExchange& exchange, const absl::StatusOr<PlanningJob>& job) {
  if (!job.ok()) return ReplyError(exchange, job.status());
  ReplyJson(exchange, 200, MessageJson(PlanningJobToProto(*job)));
}

// The request id may stand in the header or in the body.
absl::StatusOr<std::string> RequestId(const HttpRequest& request, const std::string& in_body) {
  const std::string in_header = request.Header("idempotency-key");
  if (!in_header.empty() && !in_body.empty() && in_header != in_body) {
    return InvalidFields({{"request_id", "differs from the Idempotency-Key header"}});
  }
  return in_header.empty() ? in_body : in_header;
}

std::vector<JobFile> FilesOf(const google::protobuf::RepeatedPtrField<v1::JobFile>& files) {
  std::vector<JobFile> result;
  for (const v1::JobFile& file : files) {
    result.push_back(
        {.name = file.name(), .digest = file.digest(), .size_bytes = file.size_bytes()});
  }
  return result;
}

absl::StatusOr<v1::ListPlanningJobsRequest> ReadListQuery(const HttpRequest& request) {
  v1::ListPlanningJobsRequest list;
  std::set<std::string> seen;
  for (const auto& [name, value] : request.url.query) {
    if (name == "state") {
      v1::PlanningJob::State state = v1::PlanningJob::UNSPECIFIED;
      if (!v1::PlanningJob::State_Parse(value, &state) || state == v1::PlanningJob::UNSPECIFIED) {
        return InvalidFields({{"state", absl::StrCat("is \"", value.substr(0, 60),
                                                     "\", must be QUEUED, RUNNING, SUCCEEDED, "
                                                     "FAILED or CANCELLED")}});
      }
      list.add_states(state);
    } else if (name == "kind") {
      list.add_kinds(value);
    } else if (!seen.insert(name).second) {
      return InvalidFields({{name, "is given twice"}});
    } else if (name == "page_size") {
      SIGHTLINE_ASSIGN_OR_RETURN(int64_t size, ReadInteger("page_size", value, 1, 1000));
      list.set_page_size(static_cast<int32_t>(size));
    } else if (name == "page_token") {
      list.set_page_token(value);
    } else if (name == "all_clients") {
      if (value != "true" && value != "1" && value != "false" && value != "0") {
        return InvalidFields({{"all_clients", "must be true or false"}});
      }
      list.set_all_clients(value == "true" || value == "1");
    } else {
      return InvalidFields({{name,
                             "is not known; there are state, kind, page_size, page_token and "
                             "all_clients"}});
    }
  }
  return list;
}

}  // namespace

Routes::Routes(PlanningJobs* jobs, ClientAccess* access, BrowserGuard guard, int max_event_streams,
               int64_t max_body_memory_bytes, const std::vector<WebFile>& web_files)
    : jobs_(jobs),
      access_(access),
      guard_(std::move(guard)),
      event_streams_(2 * int64_t{max_event_streams}, max_event_streams),
      body_memory_(max_body_memory_bytes, max_body_memory_bytes / 2),
      openapi_(OpenApiJson()),
      routes_{
          {"POST", {"v1", "jobs"}, &Routes::CreateJob},
          {"GET", {"v1", "jobs"}, &Routes::ListJobs},
          {"GET", {"v1", "jobs", "*"}, &Routes::GetJob},
          {"DELETE", {"v1", "jobs", "*"}, &Routes::CancelJob},
          {"GET", {"v1", "jobs", "*", "events"}, &Routes::WatchJob},
          {"GET", {"v1", "jobs", "*", "results"}, &Routes::ListResults},
          {"GET", {"v1", "jobs", "*", "results", "**"}, &Routes::GetResult},
          {"PUT", {"v1", "files"}, &Routes::PutFile},
          {"PUT", {"v1", "recipes", "*"}, &Routes::PutRecipe},
          {"DELETE", {"v1", "recipes", "*"}, &Routes::DeleteRecipe},
          {"POST", {"v1", "recipes", "*", "start"}, &Routes::StartRecipe},
          {"GET", {"v1", "state"}, &Routes::GetState},
      } {
  for (const WebFile& file : web_files) {
    web_files_[file.path] = {file, absl::StrCat("\"", Sha256Hex(file.bytes), "\"")};
  }
  if (web_files_.count("/") == 0 && web_files_.count("/index.html") > 0) {
    web_files_["/"] = web_files_["/index.html"];
  }
}

bool Routes::Matches(const Path& pattern, const Path& path) {
  for (size_t i = 0; i < pattern.size(); ++i) {
    if (i >= path.size() || path[i].empty()) return false;
    if (pattern[i] == "**") return true;
    if (pattern[i] != "*" && pattern[i] != path[i]) return false;
  }
  return pattern.size() == path.size();
}

bool Routes::AnswerWebFile(HttpExchange& exchange) {
  const HttpRequest& request = exchange.request();
  const std::string path = absl::StrCat("/", absl::StrJoin(request.url.path, "/"));
  if (path == "/healthz") {
    ReplyText(exchange, 200, {{"Cache-Control", "no-store"}}, "text/plain; charset=utf-8", "ok\n");
    return true;
  }
  if (path == "/v1/openapi.json") {
    ReplyText(exchange, 200, {{"Cache-Control", "no-cache"}}, "application/json", openapi_);
    return true;
  }
  const auto found = web_files_.find(path);
  if (found == web_files_.end()) {
    if (path != "/") return false;
    ReplyText(exchange, 200, {}, "text/plain; charset=utf-8",
              "Sightline planning service. Its interface is described by /v1/openapi.json.\n");
    return true;
  }
  const WebReply& web = found->second;
  HttpHeaders headers = {{"ETag", web.entity_tag}, {"Cache-Control", "no-cache"}};
  if (MatchesEntityTag(request.Header("if-none-match"), web.entity_tag)) {
    ReplyText(exchange, 304, headers, "", "");
    return true;
  }
  if (absl::StartsWith(web.file.content_type, "text/html")) {
    headers.emplace_back("Content-Security-Policy", kPagePolicy);
  }
  ReplyText(exchange, 200, headers, web.file.content_type, web.file.bytes);
  return true;
}

void Routes::Answer(HttpExchange& exchange) {
  const HttpRequest& request = exchange.request();
  if (absl::Status status = guard_.Check(request); !status.ok()) {
    return ReplyError(exchange, status);
  }
  const std::string method = request.method == "HEAD" ? "GET" : request.method;
  if (method == "GET" && AnswerWebFile(exchange)) return;
  std::vector<std::string> allowed;
  const Route* chosen = nullptr;
  for (const Route& route : routes_) {
    if (!Matches(route.pattern, request.url.path)) continue;
    allowed.push_back(route.method);
    if (method == route.method) chosen = &route;
  }
  if (chosen == nullptr && allowed.empty()) {
    return ReplyError(exchange, WithErrorInfo(absl::NotFoundError("there is nothing at this path"),
                                              "PATH_UNKNOWN"));
  }
  if (chosen == nullptr) {
    const std::string methods = absl::StrJoin(allowed, ", ");
    return ReplyError(
        exchange,
        WithErrorInfo(absl::UnimplementedError(absl::StrCat("method ", request.method,
                                                            " is not one of this path: ", methods)),
                      "METHOD_NOT_ALLOWED"),
        {{"Allow", methods}});
  }
  absl::StatusOr<Client> client = access_->Identify(request.peer);
  if (!client.ok()) return ReplyError(exchange, client.status());
  Handle(*chosen, exchange, *client);
}

void Routes::Handle(const Route& route, HttpExchange& exchange, const Client& client) {
  try {
    (this->*route.handler)(exchange, client, exchange.request().url.path);
  } catch (const std::bad_alloc&) {
    if (exchange.has_begun()) throw;
    spdlog::error("event=http_out_of_memory client={:?}", client.name);
    ReplyError(exchange,
               WithErrorInfo(absl::UnavailableError("overloaded: the service is out of memory"),
                             "OVERLOADED"));
  }
}

void Routes::CreateJob(HttpExchange& exchange, const Client& client, const Path&) {
  SharedLimit::Share memory = body_memory_.Of(client.name);
  v1::CreatePlanningJobRequest body;
  std::vector<JobFile> files;
  if (IsMultipartForm(exchange.request())) {
    absl::StatusOr<TaskForm> form = ReadTaskForm(exchange, jobs_, client, &memory);
    if (!form.ok()) return ReplyError(exchange, form.status());
    *body.mutable_task() = std::move(form->task);
    body.set_priority(form->priority);
    files = std::move(form->files);
  } else {
    absl::Status status = ReadJsonBody(exchange, /*may_be_empty=*/false, &memory, &body);
    if (!status.ok()) return ReplyError(exchange, status);
    if (!body.has_task()) {
      return ReplyError(exchange, InvalidFields({{"task", "is missing"}}));
    }
    files = FilesOf(body.files());
  }
  absl::StatusOr<std::string> request_id = RequestId(exchange.request(), body.request_id());
  if (!request_id.ok()) return ReplyError(exchange, request_id.status());
  ReplyNewJob(exchange,
              jobs_->Create(client, *request_id, body.task(), std::move(files), body.priority()));
}

void Routes::ListJobs(HttpExchange& exchange, const Client& client, const Path&) {
  absl::StatusOr<v1::ListPlanningJobsRequest> query = ReadListQuery(exchange.request());
  if (!query.ok()) return ReplyError(exchange, query.status());
  absl::StatusOr<PlanningJobs::Page> page = jobs_->List(client, *query);
  if (!page.ok()) return ReplyError(exchange, page.status());
  v1::ListPlanningJobsResponse response;
  for (const PlanningJob& job : page->jobs) *response.add_jobs() = PlanningJobToProto(job);
  response.set_next_page_token(page->next_page_token);
  ReplyJson(exchange, 200, MessageJson(response));
}

void Routes::GetJob(HttpExchange& exchange, const Client& client, const Path& path) {
  ReplyJob(exchange, jobs_->Get(client, path[2]));
}

void Routes::CancelJob(HttpExchange& exchange, const Client& client, const Path& path) {
  ReplyJob(exchange, jobs_->Cancel(client, path[2]));
}

void Routes::WatchJob(HttpExchange& exchange, const Client& client, const Path& path) {
  SharedLimit::Share stream = event_streams_.Of(client.name);
  if (const std::optional<Shortage> shortage = stream.Grow(1)) {
    return ReplyError(
        exchange, WithErrorInfo(absl::ResourceExhaustedError(
                                    absl::StrCat(shortage->of_owner ? "you have " : "clients have ",
                                                 shortage->held, " event streams already, at most ",
                                                 shortage->limit, " are allowed at a time")),
                                "TOO_MANY_EVENT_STREAMS"));
  }
  StreamEvents(exchange, jobs_, client, path[2]);
}

void Routes::ListResults(HttpExchange& exchange, const Client& client, const Path& path) {
  absl::StatusOr<PlanningJob> job = jobs_->Get(client, path[2]);
  if (!job.ok()) return ReplyError(exchange, job.status());
  if (!job->IsFinished()) {
    return ReplyError(exchange, WithErrorInfo(absl::FailedPreconditionError(
                                                  "the job is not finished; it has no results yet"),
                                              "JOB_NOT_FINISHED"));
  }
  const v1::PlanningJob message = PlanningJobToProto(*job);
  std::vector<std::string> files;
  for (const v1::JobFile& file : message.results()) {
    files.push_back(MessageJson(file));
  }
  ReplyJson(exchange, 200, absl::StrCat("{\"results\":[", absl::StrJoin(files, ","), "]}"));
}

void Routes::GetResult(HttpExchange& exchange, const Client& client, const Path& path) {
  const std::string name = absl::StrJoin(path.begin() + 4, path.end(), "/");
  absl::StatusOr<OpenResult> result = jobs_->Result(client, path[2], name);
  if (!result.ok()) return ReplyError(exchange, result.status());
  ReplyResult(exchange, *result);
}

void Routes::PutFile(HttpExchange& exchange, const Client& client, const Path&) {
  std::string expected_digest;
  for (const auto& [name, value] : exchange.request().url.query) {
    if (name != "digest") {
      return ReplyError(exchange, InvalidFields({{name, "is not known; there is digest"}}));
    }
    expected_digest = value;
  }
  absl::StatusOr<JobFile> file = ReadFileBody(exchange, jobs_, client, expected_digest);
  if (!file.ok()) return ReplyError(exchange, file.status());
  v1::UploadFileResponse response;
  response.set_digest(file->digest);
  response.set_size_bytes(file->size_bytes);
  ReplyJson(exchange, 201, MessageJson(response));
}

void Routes::PutRecipe(HttpExchange& exchange, const Client& client, const Path& path) {
  SharedLimit::Share memory = body_memory_.Of(client.name);
  v1::PrepareRecipeRequest body;
  std::vector<JobFile> files;
  if (IsMultipartForm(exchange.request())) {
    absl::StatusOr<TaskForm> form = ReadTaskForm(exchange, jobs_, client, &memory);
    if (!form.ok()) return ReplyError(exchange, form.status());
    if (form->has_priority) {
      return ReplyError(exchange,
                        InvalidFields({{"priority", "a recipe has none; give it at its start"}}));
    }
    *body.mutable_task() = std::move(form->task);
    files = std::move(form->files);
  } else {
    absl::Status status = ReadJsonBody(exchange, /*may_be_empty=*/false, &memory, &body);
    if (!status.ok()) return ReplyError(exchange, status);
    if (!body.has_task()) {
      return ReplyError(exchange, InvalidFields({{"task", "is missing"}}));
    }
    if (!body.recipe_id().empty() && body.recipe_id() != path[2]) {
      return ReplyError(exchange, InvalidFields({{"recipe_id", "differs from the path"}}));
    }
    files = FilesOf(body.files());
  }
  absl::StatusOr<std::string> digest =
      jobs_->PrepareRecipe(client, path[2], body.task(), std::move(files));
  if (!digest.ok()) return ReplyError(exchange, digest.status());
  v1::PrepareRecipeResponse response;
  response.set_recipe_id(path[2]);
  response.set_digest(*digest);
  ReplyJson(exchange, 200, MessageJson(response));
}

void Routes::DeleteRecipe(HttpExchange& exchange, const Client& client, const Path& path) {
  if (absl::Status status = jobs_->UnprepareRecipe(client, path[2]); !status.ok()) {
    return ReplyError(exchange, status);
  }
  ReplyText(exchange, 204, {}, "", "");
}

void Routes::StartRecipe(HttpExchange& exchange, const Client& client, const Path& path) {
  SharedLimit::Share memory = body_memory_.Of(client.name);
  v1::StartJobRequest body;
  if (absl::Status status = ReadJsonBody(exchange, /*may_be_empty=*/true, &memory, &body);
      !status.ok()) {
    return ReplyError(exchange, status);
  }
  if (!body.recipe_id().empty() && body.recipe_id() != path[2]) {
    return ReplyError(exchange, InvalidFields({{"recipe_id", "differs from the path"}}));
  }
  absl::StatusOr<std::string> request_id = RequestId(exchange.request(), body.request_id());
  if (!request_id.ok()) return ReplyError(exchange, request_id.status());
  ReplyNewJob(exchange, jobs_->StartJob(client, *request_id, path[2], body.priority()));
}

void Routes::GetState(HttpExchange& exchange, const Client& client, const Path&) {
  absl::StatusOr<v1::GetVisionStateResponse> state = jobs_->VisionState(client);
  if (!state.ok()) return ReplyError(exchange, state.status());
  ReplyJson(exchange, 200, MessageJson(*state));
}

}  // namespace sightline
