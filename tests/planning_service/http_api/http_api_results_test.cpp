// SPDX-License-Identifier: Apache-2.0
// Results and the web page over HTTP.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/planning_service/http_api/http_api_fixture.h"

namespace sightline {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class HttpApiResults : public HttpApiTest {
 protected:
  void SetUp() override {
    HttpApiTest::SetUp();
    StartServer();
    client_ = NewClient();
    for (int i = 0; i < 300000; ++i) points_ += static_cast<char>(int64_t{i} * 7919 >> 3);
    path_ = "/v1/jobs/" + CreateJob() + "/results";
  }
  void TearDown() override {
    client_.reset();
    HttpApiTest::TearDown();
  }
  void Finish() {
    Succeed(Claim(), {{"plan.json", "{}"},
                      {"points/scan_01.ply", points_},
                      {"report.html", "<html>report</html>"},
                      {"empty.csv", ""}});
  }

  std::string points_;
  std::string path_;
  std::unique_ptr<httplib::Client> client_;
};

TEST_F(HttpApiResults, AreThereWhenTheJobHasSucceeded) {
  Error(client_->Get(path_), 409, "JOB_NOT_FINISHED");
  Error(client_->Get(path_ + "/plan.json"), 409, "JOB_NOT_FINISHED");
  Finish();
  const json list = Json(client_->Get(path_))["results"];
  ASSERT_EQ(list.size(), 4u);
  for (const json& file : list) {
    if (file["name"] != "points/scan_01.ply") continue;
    EXPECT_EQ(file["digest"], Sha256Hex(points_));
    EXPECT_EQ(file["size_bytes"], points_.size());
  }
  for (const char* name : {"/points/scan_01.ply", "/points%2Fscan_01.ply"}) {
    const auto answer = client_->Get(path_ + name);
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->status, 200);
    EXPECT_TRUE(answer->body == points_);
    EXPECT_EQ(answer->get_header_value("Content-Length"), std::to_string(points_.size()));
    EXPECT_EQ(answer->get_header_value("ETag"), "\"" + Sha256Hex(points_) + "\"");
    EXPECT_EQ(answer->get_header_value("Content-Type"), "application/octet-stream");
    EXPECT_EQ(answer->get_header_value("X-Content-Type-Options"), "nosniff");
  }
  const auto empty = client_->Get(path_ + "/empty.csv");
  EXPECT_EQ(empty->status, 200);
  EXPECT_THAT(empty->body, IsEmpty());
  EXPECT_EQ(empty->get_header_value("Content-Type"), "text/csv; charset=utf-8");
  const auto head = client_->Head(path_ + "/points/scan_01.ply");
  EXPECT_EQ(head->status, 200);
  EXPECT_EQ(head->get_header_value("Content-Length"), std::to_string(points_.size()));
  for (const char* name : {"/none.json", "/points", "/../plan.json", "/points%2f..%2fplan.json"}) {
    Error(client_->Get(path_ + name), 404, "RESULT_UNKNOWN");
  }
}

TEST_F(HttpApiResults, OfReportsAreSandboxed) {
  Finish();
  const auto report = client_->Get(path_ + "/report.html");
  EXPECT_EQ(report->get_header_value("Content-Type"), "text/html; charset=utf-8");
  const std::string policy = report->get_header_value("Content-Security-Policy");
  EXPECT_THAT(policy, HasSubstr("sandbox allow-scripts"));
  EXPECT_THAT(policy, HasSubstr("default-src 'none'"));
  EXPECT_THAT(policy, HasSubstr("img-src data:"));
  EXPECT_FALSE(client_->Get(path_ + "/plan.json")->has_header("Content-Security-Policy"));
}

TEST_F(HttpApiResults, AreNotSentTwice) {
  Finish();
  const std::string file = path_ + "/points/scan_01.ply";
  const std::string tag = "\"" + Sha256Hex(points_) + "\"";
  for (const std::string& known : {tag, "\"other\", W/" + tag, std::string("*")}) {
    // This client takes the body of a 304, which has none, to end with the connection.
    const auto answer = client_->Get(file, {{"If-None-Match", known}, {"Connection", "close"}});
    EXPECT_EQ(answer->status, 304);
    EXPECT_EQ(answer->get_header_value("ETag"), tag);
    EXPECT_THAT(answer->body, IsEmpty());
  }
  EXPECT_EQ(client_->Get(file, {{"If-None-Match", "\"other\""}})->status, 200);
}

TEST_F(HttpApiResults, AreSentInRanges) {
  Finish();
  const std::string file = path_ + "/points/scan_01.ply";
  const auto range = [&](const std::string& text) { return client_->Get(file, {{"Range", text}}); };
  auto answer = range("bytes=100000-199999");
  EXPECT_EQ(answer->status, 206);
  EXPECT_TRUE(answer->body == points_.substr(100000, 100000));
  EXPECT_EQ(answer->get_header_value("Content-Range"), "bytes 100000-199999/300000");
  answer = range("bytes=-5");
  EXPECT_EQ(answer->status, 206);
  EXPECT_TRUE(answer->body == points_.substr(299995));
  answer = range("bytes=299999-");
  EXPECT_TRUE(answer->body == points_.substr(299999));
  answer = range("bytes=300000-");
  Error(answer, 416, "RANGE_NOT_SATISFIABLE");
  EXPECT_EQ(answer->get_header_value("Content-Range"), "bytes */300000");
  EXPECT_EQ(range("bytes=0-1,5-6")->status, 200);
  EXPECT_EQ(range("lines=0-1")->status, 200);
  const std::string tag = "\"" + Sha256Hex(points_) + "\"";
  EXPECT_EQ(client_->Get(file, {{"Range", "bytes=0-1"}, {"If-Range", tag}})->status, 206);
  EXPECT_EQ(client_->Get(file, {{"Range", "bytes=0-1"}, {"If-Range", "\"old\""}})->status, 200);
}

TEST_F(HttpApiResults, ThatAreLostAreSaidToBe) {
  Finish();
  const auto path = artefacts_->Path(Sha256Hex(points_));
  ASSERT_TRUE(path.ok());
  std::filesystem::permissions(*path, std::filesystem::perms::owner_all);
  std::filesystem::resize_file(*path, 10);
  Error(client_->Get(path_ + "/points/scan_01.ply"), 500, "DATA_LOSS");
}

// Damage that leaves the size as it is: every byte counts, before and after a good delivery.
TEST_F(HttpApiResults, ThatAreDamagedAreNotDelivered) {
  Finish();
  const auto path = artefacts_->Path(Sha256Hex(points_));
  ASSERT_TRUE(path.ok());
  std::filesystem::permissions(*path, std::filesystem::perms::owner_all);
  const std::string name = path_ + "/points/scan_01.ply";
  const auto set_byte = [&](size_t at, char value) {
    std::fstream file(*path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(at));
    file.put(value);
  };
  for (const size_t at : {size_t{0}, points_.size() / 2, points_.size() - 1}) {
    EXPECT_EQ(client_->Get(name)->status, 200) << at;
    set_byte(at, static_cast<char>(points_[at] ^ 1));
    Error(client_->Get(name), 500, "DATA_LOSS");
    Error(client_->Get(name, {{"Range", "bytes=7-9"}}), 500, "DATA_LOSS");
    set_byte(at, points_[at]);
  }
}

using HttpApiPage = HttpApiTest;

TEST_F(HttpApiPage, IsServedFromItsTable) {
  options_.web_files = {{"/index.html", "text/html; charset=utf-8", "<html>page</html>"},
                        {"/assets/page.js", "text/javascript", "let x = 1;"}};
  StartServer();
  const auto client = NewClient();
  const auto page = client->Get("/");
  EXPECT_EQ(page->body, "<html>page</html>");
  EXPECT_THAT(page->get_header_value("Content-Security-Policy"), HasSubstr("script-src 'self'"));
  const auto script = client->Get("/assets/page.js");
  EXPECT_EQ(script->body, "let x = 1;");
  EXPECT_EQ(script->get_header_value("Content-Type"), "text/javascript");
  const httplib::Headers known = {{"If-None-Match", script->get_header_value("ETag")},
                                  {"Connection", "close"}};
  EXPECT_EQ(client->Get("/assets/page.js", known)->status, 304);
  Error(client->Get("/assets"), 404, "PATH_UNKNOWN");
}

TEST_F(HttpApiPage, IsPlainWithoutATable) {
  StartServer();
  EXPECT_THAT(NewClient()->Get("/")->body, HasSubstr("/v1/openapi.json"));
  EXPECT_EQ(Json(NewClient()->Get("/v1/openapi.json"))["openapi"], "3.0.3");
}

}  // namespace
}  // namespace sightline
