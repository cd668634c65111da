// SPDX-License-Identifier: Apache-2.0
#include "planner_client/explore/explore_routes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "planner_client/explore/explore_page.h"
#include "tests/planner_client/explore/explore_fixture.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

// A request with its whole body, and the answer to it.
class RecordedExchange final : public HttpExchange {
 public:
  RecordedExchange(const std::string& method, const std::string& path, std::string body)
      : body_(std::move(body)) {
    request_.method = method;
    request_.url = *ParseRequestTarget(path);
    request_.headers = {{"host", "127.0.0.1:8090"}, {"content-type", "application/json"}};
  }

  HttpRequest& change() { return request_; }
  const HttpRequest& request() const override { return request_; }
  absl::StatusOr<std::string> ReadBody() override { return std::exchange(body_, ""); }
  absl::Status Begin(int http_status, const HttpHeaders& given, std::optional<int64_t>) override {
    status = http_status;
    for (const auto& [name, value] : given) headers[name] = value;
    return absl::OkStatus();
  }
  absl::Status Write(absl::string_view bytes) override {
    answer.append(bytes.data(), bytes.size());
    return absl::OkStatus();
  }
  absl::Status End() override { return absl::OkStatus(); }
  bool has_begun() const override { return status != 0; }
  bool IsWanted() const override { return true; }

  int status = 0;
  std::map<std::string, std::string> headers;
  std::string answer;

 private:
  HttpRequest request_;
  std::string body_;
};

class ExploreRoutesTest : public ::testing::Test {
 protected:
  void SetUp() override { session_ = *ExploreSession::Open(LineTask(&gain_model_)); }
  RecordedExchange Ask(const std::string& method, const std::string& path,
                       const std::string& body = "") {
    RecordedExchange exchange(method, path, body);
    Answer(exchange);
    return exchange;
  }
  void Answer(HttpExchange& exchange) const {
    ExploreRoutes(session_.get(), BrowserGuard({"127.0.0.1"})).Answer(exchange);
  }

  FunctionGainModel gain_model_ = LineGainModel();
  std::unique_ptr<ExploreSession> session_;
};

TEST_F(ExploreRoutesTest, ServesThePageWithAPolicyThatLoadsNothingFromElsewhere) {
  const RecordedExchange page = Ask("GET", "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_THAT(page.answer, HasSubstr("explore.js"));
  EXPECT_THAT(page.headers.at("Content-Security-Policy"), HasSubstr("default-src 'none'"));
  for (const char* path : {"/explore.js", "/explore.css"}) {
    EXPECT_EQ(Ask("GET", path).status, 200) << path;
  }
  for (const ExplorePageFile& file : ExplorePage()) {
    if (file.path == "/explore.js") continue;  // three.js names addresses in its comments
    EXPECT_EQ(file.bytes.find("http"), std::string_view::npos) << file.path;
  }
}

TEST_F(ExploreRoutesTest, AnswersWithJson) {
  EXPECT_EQ(Json::parse(Ask("GET", "/api/setup").answer)["name"], "line");
  EXPECT_TRUE(Json::parse(Ask("GET", "/api/scene").answer).contains("mesh"));
  EXPECT_TRUE(Json::parse(Ask("GET", "/api/suggestion").answer).contains("running"));
  const Json request = {{"measurement", LineMeasurement(0)}, {"exact", true}};
  const RecordedExchange scan = Ask("POST", "/api/scan", request.dump());
  EXPECT_EQ(scan.status, 200);
  EXPECT_EQ(Json::parse(scan.answer)["new_targets"], 21);
  const Json add = {{"action", "add"},
                    {"revision", session_->State()["revision"]},
                    {"measurement", LineMeasurement(0)}};
  EXPECT_EQ(Ask("POST", "/api/plan", add.dump()).status, 200);
  EXPECT_EQ(Json::parse(Ask("GET", "/api/state").answer)["scans"].size(), 1);
  EXPECT_EQ(Ask("POST", "/api/suggestion/cancel", "{}").status, 200);
  EXPECT_EQ(Ask("POST", "/api/save", "{}").status, 200);
}

TEST_F(ExploreRoutesTest, ErrorsHaveCodeAndFields) {
  Json measurement = LineMeasurement(0);
  measurement["offset_y_m"] = 7;
  const RecordedExchange wrong =
      Ask("POST", "/api/scan", Json{{"measurement", measurement}}.dump());
  EXPECT_EQ(wrong.status, 400);
  EXPECT_EQ(Json::parse(wrong.answer)["error"]["fields"][0]["field"], "measurement.offset_y_m");
  EXPECT_EQ(Ask("POST", "/api/scan", "{\"measurement\": NaN}").status, 400);
  EXPECT_EQ(Ask("POST", "/api/scan", "").status, 400);
  EXPECT_EQ(Ask("POST", "/api/nothing", "{}").status, 404);
  EXPECT_EQ(Ask("GET", "/../etc/passwd").status, 404);
  EXPECT_EQ(Ask("DELETE", "/api/state").status, 405);
  EXPECT_EQ(Ask("GET", "/api/scan").status, 405);
  const Json stale = {{"action", "remove"}, {"revision", 77}, {"index", 0}};
  EXPECT_EQ(Ask("POST", "/api/plan", stale.dump()).status, 409);
}

TEST_F(ExploreRoutesTest, PagesOfOtherSitesChangeNothing) {
  const std::string body = Json{{"measurement", LineMeasurement(0.3)}}.dump();
  const Json before = session_->State();
  RecordedExchange renamed("GET", "/api/state", "");
  renamed.change().headers["host"] = "evil.example";
  Answer(renamed);
  EXPECT_EQ(renamed.status, 403);
  RecordedExchange foreign("POST", "/api/scan", body);
  foreign.change().headers["origin"] = "http://evil.example";
  Answer(foreign);
  EXPECT_EQ(foreign.status, 403);
  // A form of another page, where the browser sends no origin.
  RecordedExchange form("POST", "/api/scan", body);
  form.change().headers["content-type"] = "text/plain";
  Answer(form);
  EXPECT_EQ(form.status, 415);
  EXPECT_EQ(session_->State(), before);
}

}  // namespace
}  // namespace sightline
