// SPDX-License-Identifier: Apache-2.0
// An HTTP front end over a real job store and artefact store in a temporary folder.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "planning_service/http_api/http_api.h"

namespace sightline {

inline constexpr char kPlanTask[] =
    R"({"kind": "plan", "inspection": {"part": {"file": "part.glb"}}, "seed": 7})";

class HttpApiTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = "/tmp/sightline-http-XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
    auto store = OpenSqliteJobStore((folder_ / "jobs.db").string());
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
    auto artefacts = ArtefactStore::Open((folder_ / "artefacts").string(), 0);
    ASSERT_TRUE(artefacts.ok()) << artefacts.status();
    artefacts_ = *std::move(artefacts);
    files_at_start_ = CountFiles();
    jobs_ = std::make_unique<PlanningJobs>(store_.get(), artefacts_.get());
    access_ = AllowEverybody();
    options_.listen = "127.0.0.1:0";
  }
  void TearDown() override {
    server_.reset();
    jobs_.reset();
    store_.reset();
    std::filesystem::remove_all(folder_);
  }

  void StartServer() {
    auto server = HttpApi::Start(options_, jobs_.get(), access_.get());
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
  }

  // Clients "line" (limits as given, a JSON text that begins with a comma) and "other", and the
  // operator "chief"; each one's token is its name and "-token-nobody-guesses".
  void UseClientsFile(const std::string& limits_of_line = "") {
    const auto client = [](const std::string& name, const std::string& more) {
      return absl::StrCat(R"({"name":")", name, R"(","token_sha256":")",
                          Sha256Hex(name + "-token-nobody-guesses"), "\"", more, "}");
    };
    const std::string file =
        Write("clients.json",
              absl::StrCat("{\"clients\":[", client("line", limits_of_line), ",",
                           client("other", ""), ",", client("chief", R"(,"operator":true)"), "]}"));
    auto access = ReadClientAccess(file);
    ASSERT_TRUE(access.ok()) << access.status();
    access_ = *std::move(access);
  }
  static httplib::Headers As(const std::string& client) {
    return {{"Authorization", absl::StrCat("Bearer ", client, "-token-nobody-guesses")}};
  }

  int port() const {
    int port = 0;
    EXPECT_TRUE(
        absl::SimpleAtoi(server_->address().substr(server_->address().rfind(':') + 1), &port));
    return port;
  }
  std::unique_ptr<httplib::Client> NewClient() const {
    auto client = std::make_unique<httplib::Client>("127.0.0.1", port());
    client->set_read_timeout(24 * 3600);
    client->set_write_timeout(24 * 3600);
    client->set_keep_alive(true);
    return client;
  }

  std::string Write(const std::string& name, const std::string& bytes) const {
    const std::string path = (folder_ / name).string();
    std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
    return path;
  }

  static nlohmann::json Json(const httplib::Result& answer) {
    EXPECT_TRUE(answer) << httplib::to_string(answer.error());
    if (!answer) return nullptr;
    auto json = nlohmann::json::parse(answer->body, nullptr, /*allow_exceptions=*/false);
    EXPECT_FALSE(json.is_discarded()) << answer->body;
    return json;
  }

  // Checks form, HTTP status and reason of an error; returns its message and fields as text.
  static std::string Error(const httplib::Result& answer, int http_status,
                           const std::string& reason) {
    const nlohmann::json json = Json(answer);
    if (!answer || !json.is_object()) return "";
    EXPECT_EQ(answer->status, http_status) << answer->body;
    EXPECT_EQ(answer->get_header_value("Content-Type"), "application/json");
    EXPECT_TRUE(json["error"]["code"].is_string()) << answer->body;
    EXPECT_EQ(json["error"].value("reason", ""), reason) << answer->body;
    EXPECT_TRUE(json["error"]["fields"].is_array()) << answer->body;
    return absl::StrCat(json["error"].value("message", ""), " ", json["error"]["fields"].dump());
  }

  static httplib::MultipartFormDataItems PlanForm(const std::string& task = kPlanTask) {
    return {{"task", task, "", "application/json"},
            {"file", "glTF bytes", "part.glb", "application/octet-stream"}};
  }
  // Id of a new job.
  std::string CreateJob(const httplib::Headers& headers = {}) const {
    const auto answer = NewClient()->Post("/v1/jobs", headers, PlanForm());
    EXPECT_TRUE(answer && answer->status == 201) << (answer ? answer->body : "no answer");
    return Json(answer).value("job_id", "");
  }

  // Starts the next job as a worker would.
  Attempt Claim() {
    auto claimed = store_->Claim([](const std::string&) { return ClientQuota(); });
    EXPECT_TRUE(claimed.ok() && claimed->has_value()) << claimed.status();
    if (!claimed.ok() || !claimed->has_value()) return {};
    return {(*claimed)->job_id, (*claimed)->attempts};
  }
  // Finishes the job with results by name.
  void Succeed(const Attempt& attempt,
               const std::vector<std::pair<std::string, std::string>>& results) {
    std::vector<JobFile> files;
    for (const auto& [name, bytes] : results) {
      auto added = artefacts_->AddFile(Write("result", bytes));
      ASSERT_TRUE(added.ok()) << added.status();
      files.push_back({name, added->digest, added->size_bytes});
    }
    const absl::Status status = store_->Succeed(attempt, files);
    ASSERT_TRUE(status.ok()) << status;
  }

  // Files that came into the artefact store, complete or not.
  int CountArtefacts() const { return CountFiles() - files_at_start_; }
  int CountFiles() const {
    int count = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "artefacts")) {
      if (entry.is_regular_file()) ++count;
    }
    return count;
  }

  std::filesystem::path folder_;
  int files_at_start_ = 0;  // the store's own
  std::unique_ptr<PlanningJobStore> store_;
  std::unique_ptr<ArtefactStore> artefacts_;
  std::unique_ptr<PlanningJobs> jobs_;
  std::unique_ptr<ClientAccess> access_;
  HttpApiOptions options_;
  std::unique_ptr<HttpApi> server_;
};

}  // namespace sightline
