// SPDX-License-Identifier: Apache-2.0
// The front end and clients that send too much, too slowly, or nonsense.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <memory>
#include <optional>
#include <thread>

#include "tests/limits/wait_until.h"
#include "tests/planning_service/http_api/http_api_fixture.h"
#include "tests/planning_service/http_api/raw_connection.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

constexpr char kHost[] = "Host: localhost\r\n";

class HttpApiLimits : public HttpApiTest {
 protected:
  // The answer to bytes after which the server closes the connection.
  std::string Exchange(const std::string& bytes) {
    RawConnection connection(port());
    EXPECT_TRUE(connection.connected());
    connection.Send(bytes);
    return connection.ReadAll();
  }
};

int64_t ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  int64_t pages = 0;
  int64_t resident = 0;
  file >> pages >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

TEST_F(HttpApiLimits, LargeFilesPassThroughWithoutBeingHeld) {
  StartServer();
  constexpr int64_t kFileBytes = 64 << 20;
  const std::string piece(1 << 20, 'x');
  const std::string head =
      absl::StrCat("--b\r\nContent-Disposition: form-data; name=task\r\n\r\n", kPlanTask,
                   "\r\n--b\r\nContent-Disposition: form-data; name=f; "
                   "filename=part.glb\r\n\r\n");
  const std::string tail = "\r\n--b--\r\n";
  RawConnection connection(port());
  const int64_t at_start = ResidentBytes();
  int64_t largest = at_start;
  ASSERT_TRUE(connection.Send(absl::StrCat(
      "POST /v1/jobs HTTP/1.1\r\n", kHost, "Content-Type: multipart/form-data; boundary=b\r\n",
      "Content-Length: ", head.size() + kFileBytes + tail.size(), "\r\nConnection: close\r\n\r\n",
      head)));
  for (int64_t sent = 0; sent < kFileBytes; sent += static_cast<int64_t>(piece.size())) {
    ASSERT_TRUE(connection.Send(piece));
    largest = std::max(largest, ResidentBytes());
  }
  ASSERT_TRUE(connection.Send(tail));
  EXPECT_THAT(connection.ReadAll(), HasSubstr("HTTP/1.1 201"));
#ifndef __SANITIZE_ADDRESS__  // it keeps freed memory to detect its use
  EXPECT_LT(largest - at_start, kFileBytes / 2);
#endif
}

TEST_F(HttpApiLimits, TakesChunkedBodies) {
  StartServer();
  const std::string answer =
      Exchange(absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost,
                            "Connection: close\r\nTransfer-Encoding: chunked\r\n\r\n",
                            "5;ext=1\r\nglTF \r\n5\r\nbytes\r\n0\r\nTrailer: x\r\n\r\n"));
  EXPECT_THAT(answer, AllOf(HasSubstr("201 Created"), HasSubstr(Sha256Hex("glTF bytes"))));
}

TEST_F(HttpApiLimits, AClientThatGoesLeavesNothingBehind) {
  StartServer();
  {
    RawConnection connection(port());
    ASSERT_TRUE(connection.Send(absl::StrCat(
        "POST /v1/jobs HTTP/1.1\r\n", kHost, "Content-Type: multipart/form-data; boundary=b\r\n",
        "Content-Length: 1000000\r\n\r\n--b\r\nContent-Disposition: form-data; name=f\r\n\r\n",
        std::string(300000, 'x'))));
    WaitUntil([this] { return CountArtefacts() == 1; });
  }
  WaitUntil([this] { return CountArtefacts() == 0; });
  EXPECT_THAT(Json(NewClient()->Get("/v1/jobs"))["jobs"], IsEmpty());
}

TEST_F(HttpApiLimits, AnswersAClientThatIsStillSending) {
  StartServer();
  auto form = PlanForm("not JSON");
  form[1].content = std::string(8 << 20, 'x');
  Error(NewClient()->Post("/v1/jobs", form), 400, "INVALID_FIELD");
}

TEST_F(HttpApiLimits, RefusesLargeRequests) {
  options_.max_request_bytes = 1000;
  StartServer();
  const std::string large(1001, 'x');
  Error(NewClient()->Put("/v1/files", large, "application/octet-stream"), 413, "REQUEST_TOO_LARGE");
  EXPECT_THAT(
      Exchange(absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost,
                            "Transfer-Encoding: chunked\r\n\r\n3e9\r\n", large, "\r\n0\r\n\r\n")),
      HasSubstr("HTTP/1.1 413"));
  EXPECT_EQ(CountArtefacts(), 0);
}

TEST_F(HttpApiLimits, JsonBodiesShareMemoryAndOneClientLeavesHalf) {
  options_.max_body_memory_bytes = int64_t{64} << 20;
  UseClientsFile();
  StartServer();
  const std::string task = absl::StrCat("{\"task\": ", kPlanTask, std::string(200 << 10, ' '), "}");
  const auto ask = [&](const std::string& client) {
    return NewClient()->Post("/v1/jobs", As(client), task, "application/json");
  };
  const auto status = [&](const std::string& client) {
    const httplib::Result answer = ask(client);
    EXPECT_TRUE(answer) << httplib::to_string(answer.error());
    return answer ? answer->status : 0;
  };
  // Beyond 1 MiB a JSON body holds memory for all that it announces, 31 MB of a client's 33; a form
  // for the text that has come, which counts twice.
  const std::pair<absl::string_view, int> bodies[] = {
      {"Content-Type: application/json\r\nContent-Length: 2600000\r\n\r\n", 2'000'000},
      {"Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 16000000\r\n\r\n"
       "--b\r\nContent-Disposition: form-data; name=task\r\n\r\n",
       15'700'000}};
  for (const auto& [head, sent_bytes] : bodies) {
    // It never ends, so that its memory is held. On a busy machine a question may come before the
    // text is there, and take its room: then the server drops the connection, the next question is
    // taken, and all is tried again.
    std::unique_ptr<RawConnection> connection;
    std::optional<httplib::Result> refused;
    WaitUntil([&] {
      connection = std::make_unique<RawConnection>(port());
      return connection->Send(absl::StrCat("POST /v1/jobs HTTP/1.1\r\n", kHost,
                                           "Authorization: Bearer line-token-nobody-guesses\r\n",
                                           head, std::string(sent_bytes, ' '))) &&
             status("line") == 503 && refused.emplace(ask("line")) && (*refused)->status == 503;
    });
    ASSERT_TRUE(refused.has_value());
    EXPECT_THAT(Error(*refused, 503, "OVERLOADED"), HasSubstr("memory"));
    EXPECT_EQ((*refused)->get_header_value("Retry-After"), "1");
    EXPECT_NE(status("other"), 503);
    connection->Close();
    WaitUntil([&] { return status("line") != 503; });
  }
}

TEST_F(HttpApiLimits, TheLargestBodyIsRead) {
  StartServer();
  // All that memory holds for one client: the text twice, and its message.
  const std::string task = absl::StrCat("{\"task\": ", kPlanTask, "}");
  EXPECT_NE(
      NewClient()
          ->Post("/v1/jobs", task + std::string((16 << 20) - task.size(), ' '), "application/json")
          ->status,
      503);
}

TEST_F(HttpApiLimits, SaysContinueOnlyToThoseWhoMay) {
  UseClientsFile();
  StartServer();
  const std::string head = absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost,
                                        "Expect: 100-continue\r\nConnection: close\r\n"
                                        "Content-Length: 3\r\n");
  RawConnection stranger(port());
  ASSERT_TRUE(stranger.Send(head + "\r\n"));
  EXPECT_THAT(stranger.ReadUntil("}}\n"), StartsWith("HTTP/1.1 401"));
  RawConnection known(port());
  ASSERT_TRUE(known.Send(head + "Authorization: Bearer line-token-nobody-guesses\r\n\r\n"));
  EXPECT_THAT(known.ReadUntil("\r\n\r\n"), StartsWith("HTTP/1.1 100 Continue"));
  ASSERT_TRUE(known.Send("abc"));
  EXPECT_THAT(known.ReadAll(), HasSubstr("HTTP/1.1 201"));
}

TEST_F(HttpApiLimits, RefusesWhatIsNotHttp) {
  StartServer();
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"nonsense\r\n\r\n", "HTTP/1.1 400"},
      {"GET / HTTP/2.0\r\n\r\n", "HTTP/1.1 400"},
      {"GET / HTTP/1.1\r\n\r\n", "HTTP/1.1 400"},
      {"GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n", "HTTP/1.1 400"},
      {absl::StrCat("GET no-slash HTTP/1.1\r\n", kHost, "\r\n"), "HTTP/1.1 400"},
      {absl::StrCat("GET / HTTP/1.1\r\n", kHost, "bad header\r\n\r\n"), "HTTP/1.1 400"},
      {absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost,
                    "Content-Length: 1\r\nContent-Length: 2\r\n\r\nxx"),
       "HTTP/1.1 400"},
      {absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost,
                    "Content-Length: 1\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
       "HTTP/1.1 400"},
      {absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost, "Content-Length: -1\r\n\r\n"),
       "HTTP/1.1 400"},
      {absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost,
                    "Transfer-Encoding: chunked\r\n\r\nzz\r\n"),
       "HTTP/1.1 400"},
      {absl::StrCat("GET /", std::string(40000, 'a'), " HTTP/1.1\r\n", kHost, "\r\n"),
       "HTTP/1.1 431"},
      {absl::StrCat("GET / HTTP/1.1\r\n", kHost, "X: ", std::string(40000, 'a'), "\r\n\r\n"),
       "HTTP/1.1 431"},
      {"GET / HTTP/1.1\r\nX: " + std::string(200000, 'a'), "HTTP/1.1 431"},
  };
  for (const auto& [bytes, answer] : cases) {
    EXPECT_THAT(Exchange(bytes), StartsWith(answer)) << bytes.substr(0, 100);
  }
  EXPECT_EQ(NewClient()->Get("/healthz")->status, 200);
}

TEST_F(HttpApiLimits, AnswersSeveralRequestsOfAConnection) {
  StartServer();
  const std::string get = absl::StrCat("GET /healthz HTTP/1.1\r\n", kHost);
  const std::string answer =
      Exchange(absl::StrCat(get, "\r\n", "PUT /v1/files HTTP/1.1\r\n", kHost,
                            "Content-Length: 3\r\n\r\nabc", get, "Connection: close\r\n\r\n"));
  const size_t first = answer.find("HTTP/1.1 200");
  const size_t second = answer.find("HTTP/1.1 201", first);
  EXPECT_NE(answer.find("HTTP/1.1 200", second), std::string::npos) << answer;
}

TEST_F(HttpApiLimits, ABodyThatWasNotReadIsNoRequest) {
  StartServer();
  const std::string inner = absl::StrCat("GET /healthz HTTP/1.1\r\n", kHost, "\r\n");
  const std::string answer = Exchange(absl::StrCat(
      "POST /nothing HTTP/1.1\r\n", kHost, "Content-Length: ", inner.size(), "\r\n\r\n", inner));
  EXPECT_THAT(answer, AllOf(StartsWith("HTTP/1.1 404"), HasSubstr("Connection: close"),
                            Not(HasSubstr("HTTP/1.1 200"))));
}

TEST_F(HttpApiLimits, CutsOffSlowClients) {
  options_.request_timeout = absl::Milliseconds(200);
  StartServer();
  EXPECT_THAT(Exchange(""), IsEmpty());
  EXPECT_THAT(Exchange("GET / HTTP/1.1\r\n"), StartsWith("HTTP/1.1 408"));
  EXPECT_THAT(
      Exchange(absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost, "Content-Length: 10\r\n\r\nabc")),
      StartsWith("HTTP/1.1 408"));
  EXPECT_EQ(CountArtefacts(), 0);
  // Bytes that come one by one do not hold a connection either.
  RawConnection trickle(port());
  ASSERT_TRUE(trickle.Send("GET / HTTP/1.1\r\nX: "));
  WaitUntil([&] { return !trickle.Send("x"); });
}

TEST_F(HttpApiLimits, RefusesConnectionsAboveTheLimit) {
  options_.max_connections = 2;
  StartServer();
  RawConnection first(port());
  RawConnection second(port());
  // An answer shows that the connection has been taken.
  const std::string get = absl::StrCat("GET /healthz HTTP/1.1\r\n", kHost, "\r\n");
  ASSERT_TRUE(first.Send(get));
  ASSERT_THAT(first.ReadUntil("ok\n"), HasSubstr("200"));
  ASSERT_TRUE(second.Send(get));
  ASSERT_THAT(second.ReadUntil("ok\n"), HasSubstr("200"));
  const auto refused = NewClient()->Get("/healthz");
  Error(refused, 503, "TOO_MANY_CONNECTIONS");
  EXPECT_THAT(refused->get_header_value("Retry-After"), Not(IsEmpty()));
  second.Close();
  WaitUntil([this] {
    const auto answer = NewClient()->Get("/healthz");
    return answer && answer->status == 200;
  });
}

TEST_F(HttpApiLimits, StopLetsARequestFinish) {
  StartServer();
  RawConnection connection(port());
  ASSERT_TRUE(
      connection.Send(absl::StrCat("PUT /v1/files HTTP/1.1\r\n", kHost,
                                   "Content-Length: 100001\r\n\r\n", std::string(100000, 'x'))));
  WaitUntil([this] { return CountArtefacts() == 1; });
  std::thread stop([this] { server_->Stop(); });
  // Once new connections are refused the stop is under way.
  WaitUntil([this] { return !RawConnection(port()).connected(); });
  EXPECT_TRUE(connection.Send("x"));
  EXPECT_THAT(connection.ReadAll(),
              AllOf(HasSubstr("201 Created"), HasSubstr("Connection: close")));
  stop.join();
}

TEST_F(HttpApiLimits, RefusesOtherHostsAndOrigins) {
  options_.allowed_hosts = {"planner.plant"};
  StartServer();
  const auto client = NewClient();
  Error(client->Get("/v1/jobs", {{"Host", "evil.example"}}), 403, "HOST_NOT_ALLOWED");
  Error(client->Get("/", {{"Host", "evil.example:80"}}), 403, "HOST_NOT_ALLOWED");
  EXPECT_THAT(Exchange(absl::StrCat("GET http://evil.example/ HTTP/1.1\r\n", kHost,
                                    "Connection: close\r\n\r\n")),
              StartsWith("HTTP/1.1 403"));
  for (const char* host : {"localhost", "127.0.0.1:1", "[::1]:8080", "Planner.Plant:443"}) {
    EXPECT_EQ(client->Get("/v1/jobs", {{"Host", host}})->status, 200) << host;
  }
  const auto post = [&](const std::string& origin) {
    return client->Post("/v1/jobs", {{"Origin", origin}}, PlanForm());
  };
  Error(post("http://evil.example"), 403, "ORIGIN_NOT_ALLOWED");
  Error(post("null"), 403, "ORIGIN_NOT_ALLOWED");
  Error(post(absl::StrCat("http://127.0.0.1:", port() + 1)), 403, "ORIGIN_NOT_ALLOWED");
  Error(client->Delete("/v1/jobs/x", {{"Sec-Fetch-Site", "cross-site"}}), 403,
        "ORIGIN_NOT_ALLOWED");
  EXPECT_EQ(CountArtefacts(), 0);
  EXPECT_EQ(post(absl::StrCat("http://127.0.0.1:", port()))->status, 201);
}

TEST_F(HttpApiLimits, NamesOptionsThatCannotBeUsed) {
  for (const char* listen : {"", "8080", ":8080", "localhost", "localhost:x", "localhost:70000",
                             "::1:8080", "unix:/tmp/x", "no such host:1"}) {
    options_.listen = listen;
    const auto server = HttpApi::Start(options_, jobs_.get(), access_.get());
    EXPECT_TRUE(absl::IsInvalidArgument(server.status())) << listen << server.status();
    EXPECT_THAT(std::string(server.status().message()), HasSubstr("--http"));
  }
  options_.listen = "127.0.0.1:0";
  StartServer();
  options_.listen = server_->address();
  const auto second = HttpApi::Start(options_, jobs_.get(), access_.get());
  EXPECT_TRUE(absl::IsUnavailable(second.status())) << second.status();
  EXPECT_THAT(std::string(second.status().message()), HasSubstr(server_->address()));
}

}  // namespace
}  // namespace sightline
