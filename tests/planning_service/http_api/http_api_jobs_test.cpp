// SPDX-License-Identifier: Apache-2.0
// Jobs, events and recipes over HTTP.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <map>
#include <thread>

#include "absl/strings/str_split.h"
#include "tests/planning_service/http_api/http_api_fixture.h"
#include "tests/planning_service/http_api/raw_connection.h"

namespace sightline {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

using HttpApiJobs = HttpApiTest;

struct Event {
  std::string id;
  std::string type;
  json data;
};

std::vector<Event> ParseEvents(const std::string& stream) {
  std::vector<Event> events;
  for (const auto& block : absl::StrSplit(stream, "\n\n", absl::SkipEmpty())) {
    Event event;
    for (const std::string& line : std::vector<std::string>(absl::StrSplit(block, '\n'))) {
      if (line.rfind("id: ", 0) == 0) event.id = line.substr(4);
      if (line.rfind("event: ", 0) == 0) event.type = line.substr(7);
      if (line.rfind("data: ", 0) == 0) event.data = json::parse(line.substr(6));
    }
    if (!event.type.empty()) events.push_back(event);
  }
  return events;
}

std::vector<std::string> Types(const std::vector<Event>& events) {
  std::vector<std::string> types;
  for (const Event& event : events) types.push_back(event.type);
  return types;
}

TEST_F(HttpApiJobs, CreatesAJobOfAForm) {
  StartServer();
  auto form = PlanForm();
  form.push_back({"priority", "-5", "", ""});
  form.push_back({"materials/steel.json", "{}", "", ""});
  const auto answer = NewClient()->Post("/v1/jobs", {{"Idempotency-Key", "order 1%2"}}, form);
  const json job = Json(answer);
  ASSERT_EQ(answer->status, 201) << answer->body;
  EXPECT_EQ(answer->get_header_value("Location"), "/v1/jobs/" + job.value("job_id", "?"));
  EXPECT_EQ(job["state"], "QUEUED");
  EXPECT_EQ(job["kind"], "plan");
  EXPECT_EQ(job["client"], "local");
  EXPECT_EQ(job["request_id"], "order 1%2");
  EXPECT_EQ(job["priority"], -5);
  EXPECT_EQ(job["progress"], 0.0);
  EXPECT_THAT(job["created_at"].get<std::string>(), StartsWith("20"));

  const auto kept = store_->Get(job["job_id"]);
  ASSERT_TRUE(kept.ok());
  ASSERT_EQ(kept->files.size(), 2u);
  std::map<std::string, std::string> digests;
  for (const JobFile& file : kept->files) digests[file.name] = file.digest;
  EXPECT_EQ(digests["part.glb"], Sha256Hex("glTF bytes"));
  EXPECT_EQ(digests["materials/steel.json"], Sha256Hex("{}"));
  v1::PlanningTask task;
  ASSERT_TRUE(task.ParseFromString(kept->task));
  EXPECT_EQ(task.seed(), 7);
  EXPECT_EQ(Json(NewClient()->Get(answer->get_header_value("Location"))), job);
}

TEST_F(HttpApiJobs, SameKeyGivesTheSameJob) {
  StartServer();
  const httplib::Headers key = {{"Idempotency-Key", "order-1"}};
  const std::string id = CreateJob(key);
  EXPECT_EQ(CreateJob(key), id);
  EXPECT_NE(CreateJob(), id);
  auto other = PlanForm();
  other[1].content = "other bytes";
  Error(NewClient()->Post("/v1/jobs", key, other), 409, "REQUEST_ID_REUSED");
}

TEST_F(HttpApiJobs, CreatesAJobOfFilesThatAreThere) {
  StartServer();
  const auto client = NewClient();
  const std::string digest = Sha256Hex("glTF bytes");
  const json file =
      Json(client->Put("/v1/files?digest=" + digest, "glTF bytes", "application/octet-stream"));
  EXPECT_EQ(file, json({{"digest", digest}, {"size_bytes", 10}}));
  json body = {{"task", json::parse(kPlanTask)},
               {"files", {{{"name", "part.glb"}, {"digest", digest}, {"size_bytes", 10}}}},
               {"priority", -1},
               {"request_id", "r1"}};
  const auto answer = client->Post("/v1/jobs", body.dump(), "application/json; charset=utf-8");
  ASSERT_EQ(answer->status, 201) << answer->body;
  EXPECT_EQ(Json(answer)["request_id"], "r1");
  EXPECT_EQ(Json(answer)["priority"], -1);
  const httplib::Headers key = {{"Idempotency-Key", "r2"}};
  EXPECT_THAT(
      Error(client->Post("/v1/jobs", key, body.dump(), "application/json"), 400, "INVALID_FIELD"),
      HasSubstr("request_id"));
  body["files"][0]["digest"] = Sha256Hex("never uploaded");
  Error(client->Post("/v1/jobs", body.dump(), "application/json"), 404, "FILE_UNKNOWN");
  Error(client->Put("/v1/files?digest=" + digest, "other", "application/octet-stream"), 400,
        "DIGEST_MISMATCH");
  Error(client->Put("/v1/files?digets=" + digest, "other", "application/octet-stream"), 400,
        "INVALID_FIELD");
}

TEST_F(HttpApiJobs, NamesWhatIsWrongWithAForm) {
  StartServer();
  const auto post = [this](const httplib::MultipartFormDataItems& form) {
    return NewClient()->Post("/v1/jobs", form);
  };
  const auto file = [](const std::string& name) {
    return httplib::MultipartFormData{"file", "x", name, ""};
  };
  const std::string reason = "INVALID_FIELD";
  EXPECT_THAT(Error(post({file("part.glb")}), 400, reason), HasSubstr("task: is missing"));
  EXPECT_THAT(Error(post(PlanForm("{\"kind\": \"plan\",")), 400, reason),
              AllOf(HasSubstr("task"), HasSubstr("line 1")));
  EXPECT_THAT(Error(post(PlanForm("not JSON")), 400, reason), HasSubstr("line 1"));
  EXPECT_THAT(Error(post(PlanForm(R"({"kind": "plan", "inspection": {"prat": {}}})")), 400, reason),
              AllOf(HasSubstr("\"field\":\"task.inspection.prat\""), HasSubstr("nearest"),
                    HasSubstr("\\\"part\\\"")));
  EXPECT_THAT(Error(post(PlanForm(R"({"kind": "dance"})")), 400, reason), HasSubstr("kind"));
  auto twice = PlanForm();
  twice.push_back(twice[0]);
  EXPECT_THAT(Error(post(twice), 400, reason), HasSubstr("task: is given twice"));
  twice = PlanForm();
  twice.push_back(file("part.glb"));
  EXPECT_THAT(Error(post(twice), 400, reason), HasSubstr("given twice"));
  for (const char* priority : {"", "high", "1.5", "101", "-101", "99999999999999999999"}) {
    auto form = PlanForm();
    form.push_back({"priority", priority, "", ""});
    EXPECT_THAT(Error(post(form), 400, reason), HasSubstr("priority")) << priority;
  }
  auto long_priority = PlanForm();
  long_priority.push_back({"priority", std::string(1000, '1'), "", ""});
  Error(post(long_priority), 413, "REQUEST_TOO_LARGE");
  for (const char* name : {"/etc/passwd", "..", "../up.stl", "a/../../b", "a//b", "./a", "a\\b",
                           "C:\\part.stl", "a/", "tab\tname", "del\x7f", "bad\xff utf8"}) {
    auto form = PlanForm();
    form.push_back(file(name));
    EXPECT_THAT(Error(post(form), 400, reason), HasSubstr("files[1].name")) << name;
  }
  EXPECT_THAT(Json(NewClient()->Get("/v1/jobs"))["jobs"], IsEmpty());
}

TEST_F(HttpApiJobs, TakesAThousandPartsAndNoMore) {
  StartServer();
  auto form = PlanForm();
  while (form.size() < 1000) form.push_back({absl::StrCat("f", form.size()), "x", "", ""});
  auto answer = NewClient()->Post("/v1/jobs", form);
  EXPECT_TRUE(answer && answer->status == 201) << (answer ? answer->body : "no answer");
  form.push_back({"one_more", "x", "", ""});
  EXPECT_THAT(Error(NewClient()->Post("/v1/jobs", form), 400, "INVALID_ARGUMENT"),
              HasSubstr("1000 parts"));
}

TEST_F(HttpApiJobs, NamesWhatIsWrongWithJson) {
  StartServer();
  const auto client = NewClient();
  const std::string type = "application/json";
  EXPECT_THAT(Error(client->Post("/v1/jobs", "{}", type), 400, "INVALID_FIELD"),
              HasSubstr("task: is missing"));
  EXPECT_THAT(Error(client->Post("/v1/jobs", "", type), 400, "INVALID_FIELD"), HasSubstr("body"));
  EXPECT_THAT(
      Error(client->Post("/v1/jobs", R"({"task": {"knid": "plan"}})", type), 400, "INVALID_FIELD"),
      AllOf(HasSubstr("task.knid"), HasSubstr("kind")));
  Error(client->Post("/v1/jobs", kPlanTask, "text/plain"), 415, "MEDIA_TYPE_NOT_SUPPORTED");
  Error(client->Post("/v1/jobs", {}, "x", "multipart/form-data"), 400, "INVALID_ARGUMENT");
  Error(client->Post("/v1/jobs", {{"Content-Encoding", "gzip"}}, "x", type), 415,
        "MEDIA_TYPE_NOT_SUPPORTED");
  Error(client->Put("/v1/files", "x", "multipart/form-data; boundary=x"), 415,
        "MEDIA_TYPE_NOT_SUPPORTED");
  EXPECT_THAT(
      Error(client->Post("/v1/jobs", std::string(17 << 20, ' '), type), 413, "REQUEST_TOO_LARGE"),
      HasSubstr("body"));
  const std::string long_key(129, 'k');
  Error(client->Post("/v1/jobs", {{"Idempotency-Key", long_key}}, PlanForm()), 400,
        "INVALID_FIELD");
}

TEST_F(HttpApiJobs, ListsNewestFirstInPages) {
  StartServer();
  const auto client = NewClient();
  std::vector<std::string> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(CreateJob());
  Succeed(Claim(), {{"plan.json", "{}"}});
  json page = Json(client->Get("/v1/jobs?page_size=2"));
  ASSERT_EQ(page["jobs"].size(), 2u);
  EXPECT_EQ(page["jobs"][0]["job_id"], ids[2]);
  EXPECT_EQ(page["jobs"][1]["job_id"], ids[1]);
  page = Json(client->Get("/v1/jobs?page_size=2&page_token=" + page.value("next_page_token", "")));
  ASSERT_EQ(page["jobs"].size(), 1u);
  EXPECT_EQ(page["jobs"][0]["job_id"], ids[0]);
  EXPECT_EQ(page["next_page_token"], "");
  EXPECT_EQ(Json(client->Get("/v1/jobs?state=SUCCEEDED&state=FAILED"))["jobs"].size(), 1u);
  EXPECT_EQ(Json(client->Get("/v1/jobs?state=QUEUED&kind=plan"))["jobs"].size(), 2u);
  EXPECT_EQ(Json(client->Get("/v1/jobs?kind=render"))["jobs"].size(), 0u);
  for (const char* wrong : {"state=DONE", "state=UNSPECIFIED", "page_size=0", "page_size=1001",
                            "page_size=x", "page_token=x", "all_clients=maybe", "stat=QUEUED",
                            "page_size=1&page_size=2", "kind=dance"}) {
    Error(client->Get(std::string("/v1/jobs?") + wrong), 400, "INVALID_FIELD");
  }
}

TEST_F(HttpApiJobs, CancelsAJob) {
  StartServer();
  const auto client = NewClient();
  const std::string id = CreateJob();
  for (int i = 0; i < 2; ++i) {
    const auto answer = client->Delete("/v1/jobs/" + id);
    EXPECT_EQ(answer->status, 200);
    EXPECT_EQ(Json(answer)["state"], "CANCELLED");
  }
  const std::string running = CreateJob();
  const Attempt attempt = Claim();
  EXPECT_EQ(Json(client->Delete("/v1/jobs/" + running))["state"], "RUNNING");
  const auto asked = store_->ReportProgress(attempt, 0.5, "working");
  ASSERT_TRUE(asked.ok()) << asked.status();
  EXPECT_TRUE(*asked);
  Error(client->Delete("/v1/jobs/no-such-job"), 404, "JOB_UNKNOWN");
}

TEST_F(HttpApiJobs, ShowsFailures) {
  StartServer();
  const std::string id = CreateJob();
  ASSERT_TRUE(
      store_->Fail(Claim(), {absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY", "big"}).ok());
  const json job = Json(NewClient()->Get("/v1/jobs/" + id));
  EXPECT_EQ(job["state"], "FAILED");
  EXPECT_EQ(
      job["failure"],
      json({{"code", "RESOURCE_EXHAUSTED"}, {"reason", "OUT_OF_MEMORY"}, {"message", "big"}}));
}

TEST_F(HttpApiJobs, StreamsEventsInOrderUntilTheLast) {
  StartServer();
  const std::string id = CreateJob();
  RawConnection watcher(port());
  ASSERT_TRUE(watcher.Send("GET /v1/jobs/" + id + "/events HTTP/1.0\r\nHost: localhost\r\n\r\n"));
  std::string stream = watcher.ReadUntil("event: accepted");
  EXPECT_THAT(stream, AllOf(HasSubstr("HTTP/1.1 200"), HasSubstr("text/event-stream")));
  // Only what is reported once the stream runs can come over it.
  const Attempt attempt = Claim();
  ASSERT_TRUE(store_->ReportProgress(attempt, 0.5, "halfway").ok());
  stream += watcher.ReadUntil("event: progress");
  Succeed(attempt, {{"plan.json", "{}"}});
  stream += watcher.ReadAll();
  const std::vector<Event> events = ParseEvents(stream.substr(stream.find("\r\n\r\n") + 4));
  ASSERT_GE(events.size(), 3u);
  EXPECT_EQ(events.front().type, "accepted");
  EXPECT_EQ(events.back().type, "done");
  EXPECT_EQ(events.back().data["state"], "SUCCEEDED");
  EXPECT_EQ(events.back().data["results"][0]["name"], "plan.json");
  for (size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].data["job_id"], id);
    if (i == 0) continue;
    EXPECT_GT(std::stoll(events[i].id), std::stoll(events[i - 1].id));
  }
}

TEST_F(HttpApiJobs, ResumesEvents) {
  StartServer();
  const auto client = NewClient();
  const std::string id = CreateJob();
  Succeed(Claim(), {});
  const std::string path = "/v1/jobs/" + id + "/events";
  const auto all = client->Get(path);
  ASSERT_TRUE(all) << httplib::to_string(all.error());
  const std::vector<Event> events = ParseEvents(all->body);
  ASSERT_GE(events.size(), 2u);
  const auto rest = client->Get(path, {{"Last-Event-ID", events[0].id}});
  ASSERT_TRUE(rest);
  std::vector<std::string> expected = Types(events);
  expected.erase(expected.begin());
  EXPECT_EQ(Types(ParseEvents(rest->body)), expected);
  // Nothing is left: a browser must not ask again.
  const auto nothing = client->Get(path, {{"Last-Event-ID", events.back().id}});
  ASSERT_TRUE(nothing);
  EXPECT_EQ(nothing->status, 204);
  // An id that the service never gave is no reason for silence: the receiver gets the present state
  // and an id that the service knows.
  const auto unknown = client->Get(path, {{"Last-Event-ID", "123456789"}});
  ASSERT_TRUE(unknown);
  EXPECT_EQ(unknown->status, 200);
  const std::vector<Event> state = ParseEvents(unknown->body);
  ASSERT_EQ(state.size(), 1u);
  EXPECT_EQ(state[0].type, "done");
  EXPECT_EQ(state[0].data["state"], "SUCCEEDED");
  EXPECT_EQ(client->Get(path, {{"Last-Event-ID", state[0].id}})->status, 204);
  EXPECT_EQ(client->Head(path)->status, 200);
  Error(client->Get(path, {{"Last-Event-ID", "x"}}), 400, "INVALID_FIELD");
  Error(client->Get(path, {{"Last-Event-ID", "-1"}}), 400, "INVALID_FIELD");
  Error(client->Get("/v1/jobs/no-such-job/events"), 404, "JOB_UNKNOWN");
}

TEST_F(HttpApiJobs, LimitsEventStreamsAndEndsThemAtStop) {
  options_.max_event_streams = 1;
  StartServer();
  const std::string path = "/v1/jobs/" + CreateJob() + "/events";
  RawConnection watcher(port());
  ASSERT_TRUE(watcher.Send("GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  EXPECT_THAT(watcher.ReadUntil("event: accepted"), HasSubstr("chunked"));
  const auto refused = NewClient()->Get(path);
  Error(refused, 503, "TOO_MANY_EVENT_STREAMS");
  EXPECT_THAT(refused->get_header_value("Retry-After"), Not(IsEmpty()));
  server_->Stop();
  EXPECT_THAT(watcher.ReadAll(), HasSubstr("0\r\n\r\n"));
  EXPECT_FALSE(NewClient()->Get("/healthz"));
}

TEST_F(HttpApiJobs, OneClientLeavesEventStreamsToTheOthers) {
  options_.max_event_streams = 1;
  UseClientsFile();
  StartServer();
  const std::string path = "/v1/jobs/" + CreateJob(As("line")) + "/events";
  const auto watch = [&](const std::string& client) {
    auto watcher = std::make_unique<RawConnection>(port());
    EXPECT_TRUE(watcher->Send("GET " + path + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: " +
                              As(client).begin()->second + "\r\n\r\n"));
    return watcher;
  };
  const auto of_line = watch("line");
  EXPECT_THAT(of_line->ReadUntil("event: accepted"), HasSubstr("chunked"));
  EXPECT_THAT(Error(NewClient()->Get(path, As("line")), 503, "TOO_MANY_EVENT_STREAMS"),
              HasSubstr("you have 1"));
  const auto of_chief = watch("chief");
  EXPECT_THAT(of_chief->ReadUntil("event: accepted"), HasSubstr("chunked"));
  // All together have twice as many.
  EXPECT_THAT(Error(NewClient()->Get(path, As("other")), 503, "TOO_MANY_EVENT_STREAMS"),
              HasSubstr("clients have 2"));
  server_->Stop();
}

TEST_F(HttpApiJobs, PreparesAndStartsRecipes) {
  StartServer();
  const auto client = NewClient();
  EXPECT_EQ(Json(client->Get("/v1/state"))["state"], "INITIALIZED");
  Error(client->Post("/v1/recipes/head/start"), 404, "RECIPE_UNKNOWN");
  // httplib's clients send forms with POST alone.
  const std::string boundary = "\r\n--b\r\nContent-Disposition: form-data; name=";
  const std::string form = boundary + "task\r\n\r\n" + kPlanTask + boundary +
                           "f; filename=part.glb\r\n\r\nglTF bytes\r\n--b--\r\n";
  const std::string type = "multipart/form-data; boundary=b";
  const auto prepared = client->Put("/v1/recipes/head%201", form, type);
  ASSERT_EQ(prepared->status, 200) << prepared->body;
  EXPECT_EQ(Json(prepared)["recipe_id"], "head 1");
  const std::string digest = Json(prepared)["digest"];
  const json body = {{"task", json::parse(kPlanTask)},
                     {"files", {{{"name", "part.glb"}, {"digest", Sha256Hex("glTF bytes")}}}}};
  EXPECT_EQ(Json(client->Put("/v1/recipes/same", body.dump(), "application/json"))["digest"],
            digest);
  EXPECT_EQ(Json(client->Get("/v1/state"))["state"], "READY");
  const auto started = client->Post("/v1/recipes/head%201/start", {{"Idempotency-Key", "o1"}},
                                    R"({"priority": -3})", "application/json");
  ASSERT_EQ(started->status, 201) << started->body;
  EXPECT_EQ(Json(started)["priority"], -3);
  EXPECT_EQ(Json(started)["request_id"], "o1");
  const auto again =
      client->Post("/v1/recipes/head%201/start", {{"Idempotency-Key", "o1"}}, "", "");
  ASSERT_TRUE(again);
  EXPECT_EQ(Json(again)["job_id"], Json(started)["job_id"]) << again->body;
  EXPECT_EQ(Json(client->Get("/v1/state"))["queued_jobs"], 1);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(client->Delete("/v1/recipes/head%201")->status, 204);
  const std::string priority = boundary + "priority\r\n\r\n1";
  EXPECT_THAT(Error(client->Put("/v1/recipes/p", priority + form, type), 400, "INVALID_FIELD"),
              HasSubstr("priority"));
  EXPECT_THAT(
      Error(client->Put("/v1/recipes/p", R"({"recipe_id": "q", "task": {}})", "application/json"),
            400, "INVALID_FIELD"),
      HasSubstr("recipe_id"));
}

TEST_F(HttpApiJobs, KeepsClientsApart) {
  UseClientsFile();
  StartServer();
  const auto client = NewClient();
  const std::string id = CreateJob(As("line"));
  Succeed(Claim(), {{"plan.json", "{}"}});
  EXPECT_EQ(Json(client->Get("/v1/jobs/" + id, As("line")))["client"], "line");
  EXPECT_EQ(Json(client->Get("/v1/jobs/" + id, As("chief")))["client"], "line");
  for (const char* path : {"", "/events", "/results", "/results/plan.json"}) {
    Error(client->Get("/v1/jobs/" + id + path, As("other")), 404, "JOB_UNKNOWN");
  }
  Error(client->Delete("/v1/jobs/" + id, As("other")), 404, "JOB_UNKNOWN");
  EXPECT_EQ(Json(client->Get("/v1/jobs", As("other")))["jobs"].size(), 0u);
  EXPECT_EQ(Json(client->Get("/v1/jobs?all_clients=true", As("chief")))["jobs"].size(), 1u);
  Error(client->Get("/v1/jobs?all_clients=true", As("other")), 403, "NOT_AN_OPERATOR");
  // A file of another client cannot be used by its digest.
  const json body = {{"task", json::parse(kPlanTask)},
                     {"files", {{{"name", "part.glb"}, {"digest", Sha256Hex("glTF bytes")}}}}};
  Error(client->Post("/v1/jobs", As("other"), body.dump(), "application/json"), 404,
        "FILE_UNKNOWN");
}

// The place in the queue counts the jobs of all clients, and reveals nothing else about them.
TEST_F(HttpApiJobs, TellsTheJobsAheadOfAllClients) {
  UseClientsFile();
  StartServer();
  const auto client = NewClient();
  const std::string foreign = CreateJob(As("line"));
  CreateJob(As("line"));
  const std::string own = CreateJob(As("other"));
  EXPECT_EQ(Json(client->Get("/v1/jobs/" + own, As("other")))["jobs_ahead"], 2);
  const json listed = Json(client->Get("/v1/jobs", As("other")));
  ASSERT_EQ(listed["jobs"].size(), 1u);
  EXPECT_EQ(listed["jobs"][0]["jobs_ahead"], 2);
  EXPECT_THAT(listed.dump(), AllOf(Not(HasSubstr(foreign)), Not(HasSubstr("line"))));
  const Attempt running = Claim();
  EXPECT_EQ(running.job_id, foreign);
  EXPECT_EQ(Json(client->Get("/v1/jobs/" + own, As("other")))["jobs_ahead"], 1);
  EXPECT_FALSE(Json(client->Get("/v1/jobs/" + foreign, As("line"))).contains("jobs_ahead"));
}

TEST_F(HttpApiJobs, AsksWhoIsThere) {
  UseClientsFile(R"(,"kinds":["render"],"max_upload_bytes":2000)");
  StartServer();
  const auto client = NewClient();
  const auto stranger = client->Get("/v1/jobs");
  Error(stranger, 401, "CREDENTIALS_UNKNOWN");
  EXPECT_THAT(stranger->get_header_value("WWW-Authenticate"), StartsWith("Bearer"));
  Error(client->Get("/v1/jobs", {{"Authorization", "Bearer wrong"}}), 401, "CREDENTIALS_UNKNOWN");
  Error(client->Get("/v1/jobs", {{"Authorization", "Basic bGluZTp4"}}), 401, "CREDENTIALS_UNKNOWN");
  Error(client->Post("/v1/jobs", PlanForm()), 401, "CREDENTIALS_UNKNOWN");
  EXPECT_EQ(CountArtefacts(), 0);
  Error(client->Post("/v1/jobs", As("line"), PlanForm()), 403, "KIND_NOT_ALLOWED");
  Error(client->Put("/v1/files", As("line"), std::string(2001, 'x'), "application/octet-stream"),
        413, "UPLOAD_TOO_LARGE");
  EXPECT_EQ(client->Get("/healthz")->status, 200);
  EXPECT_EQ(client->Get("/v1/openapi.json")->status, 200);
  EXPECT_EQ(client->Get("/")->status, 200);
}

TEST_F(HttpApiJobs, TellsWhenToComeAgainOverQuota) {
  UseClientsFile(R"(,"max_queued_jobs":1)");
  StartServer();
  CreateJob(As("line"));
  const auto answer = NewClient()->Post("/v1/jobs", As("line"), PlanForm());
  Error(answer, 429, "QUOTA_EXCEEDED");
  EXPECT_THAT(answer->get_header_value("Retry-After"), Not(IsEmpty()));
}

TEST_F(HttpApiJobs, KnowsItsPaths) {
  StartServer();
  const auto client = NewClient();
  for (const char* path : {"/nothing", "/v1", "/v1/jobs/", "/v1/jobs//events", "/v1/jobs/a/b",
                           "/v1/files/x", "/assets/none.js", "/../etc/passwd"}) {
    Error(client->Get(path), 404, "PATH_UNKNOWN");
  }
  const auto wrong = client->Delete("/v1/jobs");
  Error(wrong, 405, "METHOD_NOT_ALLOWED");
  EXPECT_EQ(wrong->get_header_value("Allow"), "POST, GET");
  Error(client->Patch("/v1/files", "x", "text/plain"), 405, "METHOD_NOT_ALLOWED");
  Error(client->Get("/v1/jobs/%zz"), 400, "INVALID_ARGUMENT");
}

TEST_F(HttpApiJobs, ServesManyClientsAtOnce) {
  StartServer();
  std::atomic<int> created{0};
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([this, i, &created] {
      const auto client = NewClient();
      for (int k = 0; k < 5; ++k) {
        const httplib::Headers key = {{"Idempotency-Key", absl::StrCat(i, "-", k)}};
        const auto answer = client->Post("/v1/jobs", key, PlanForm());
        if (answer && answer->status == 201) ++created;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(created, 40);
  EXPECT_EQ(Json(NewClient()->Get("/v1/jobs"))["jobs"].size(), 40u);
}

}  // namespace
}  // namespace sightline
