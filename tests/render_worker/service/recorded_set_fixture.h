// SPDX-License-Identifier: Apache-2.0
// A render worker that is asked about a set of recordings, which another one has rendered before.
#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "planner_client/diagnosis_client/recorded_folder.h"
#include "planner_client/render_client/render_client.h"
#include "render_worker/service/render_server.h"

namespace sightline {

// A folder with a set in set/, for as long as it lives.
class RenderedFolder {
 public:
  RenderedFolder(const v1::RenderSpec& spec, const std::vector<AssetFile>& assets) {
    if (mkdtemp(path_.data()) == nullptr) {
      ADD_FAILURE() << "no folder " << path_;
      return;
    }
    RenderServerOptions options;
    options.listen = "unix:" + path_ + "/s";
    options.spool_folder = path_;
    auto server = RenderServer::Start(options);
    EXPECT_TRUE(server.ok()) << server.status();
    if (!server.ok()) return;
    RenderClientOptions client;
    client.address = (*server)->address();
    const auto files = RenderToFolder(client, spec, assets, path_ + "/set");
    EXPECT_TRUE(files.ok()) << files.status();
  }
  ~RenderedFolder() { std::filesystem::remove_all(path_); }
  RenderedFolder(const RenderedFolder&) = delete;
  RenderedFolder& operator=(const RenderedFolder&) = delete;

  std::string set() const { return path_ + "/set"; }

 private:
  std::string path_ = "/tmp/sightline-rendered-set-XXXXXX";
};

class RecordedSetTest : public ::testing::Test {
 protected:
  // A spool, and what the folder `set` holds.
  void Open(const std::string& set) {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    std::filesystem::create_directories(folder_ + "/spool");
    auto read = ReadRecordedFolder(set);
    ASSERT_TRUE(read.ok()) << read.status();
    set_ = *std::move(read);
  }
  void TearDown() override {
    server_.reset();
    // Nothing is left behind.
    EXPECT_TRUE(std::filesystem::is_empty(folder_ + "/spool"));
    std::filesystem::remove_all(folder_);
  }

  // A worker that answers by these functions.
  void StartServer(RecordingFunctions functions, int64_t max_set_bytes = int64_t{1} << 20) {
    server_.reset();
    RenderServerOptions options;
    options.listen = "unix:" + folder_ + "/s";
    options.spool_folder = folder_ + "/spool";
    options.threads = 2;
    options.max_set_bytes = max_set_bytes;
    auto server = RenderServer::Start(options, std::move(functions));
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    client_ = {};
    client_.address = server_->address();
  }

  std::string folder_ = "/tmp/sightline-recorded-set-test-XXXXXX";
  RecordedFolder set_;
  std::unique_ptr<RenderServer> server_;
  WorkerClientOptions client_;
};

}  // namespace sightline
