// SPDX-License-Identifier: Apache-2.0
// Files that a render worker keeps on disk: for its user alone, and for a time.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/match.h"
#include "proto/status/rpc_status.h"
#include "render_worker/service/asset_store.h"
#include "render_worker/service/render_output_store.h"
#include "render_worker/service/render_server.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "sightline/v1/render_service.grpc.pb.h"
#include "tests/limits/wait_until.h"
#include "tests/render_worker/service/plate_spec.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

class KeptFilesTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    spool_ = folder_ + "/spool";
    fs::create_directories(spool_);
  }
  void TearDown() override {
    server_.reset();
    EXPECT_TRUE(fs::is_empty(spool_));
    fs::remove_all(folder_);
  }

  void Start(absl::Duration keep) {
    RenderServerOptions options;
    options.listen = "unix:" + folder_ + "/s";
    options.spool_folder = spool_;
    options.keep = keep;
    auto server = RenderServer::Start(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    const auto channel =
        grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    render_ = v1::RenderService::NewStub(channel);
    jobs_ = v1::JobService::NewStub(channel);
  }

  void Upload(const std::string& bytes) {
    grpc::ClientContext context;
    context.set_deadline(FarDeadline());
    v1::UploadAssetResponse response;
    auto writer = render_->UploadAsset(&context, &response);
    v1::UploadAssetRequest message;
    message.mutable_header()->set_size_bytes(static_cast<int64_t>(bytes.size()));
    writer->Write(message);
    message.set_chunk(bytes);
    writer->Write(message);
    writer->WritesDone();
    ASSERT_TRUE(writer->Finish().ok());
  }

  // Id of a rendering that has ended well.
  std::string Render() {
    v1::CreateRenderRequest request;
    *request.mutable_spec() = PlateSpec();
    v1::CreateRenderResponse response;
    grpc::ClientContext context;
    context.set_deadline(FarDeadline());
    EXPECT_TRUE(render_->CreateRender(&context, request, &response).ok());
    const std::string id = response.job().job_id();
    WaitUntil([&] {
      grpc::ClientContext get_context;
      get_context.set_deadline(FarDeadline());
      v1::GetJobRequest get;
      get.set_job_id(id);
      v1::GetJobResponse job;
      return !jobs_->GetJob(&get_context, get, &job).ok() ||
             job.job().state() == v1::Job::STATE_SUCCEEDED;
    });
    return id;
  }

  // Files and folders below the spool whose name begins so.
  std::vector<fs::path> Named(const std::string& prefix) const {
    std::vector<fs::path> found;
    std::error_code error;
    for (auto entry = fs::recursive_directory_iterator(spool_, error);
         !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
      if (absl::StartsWith(entry->path().filename().string(), prefix)) {
        found.push_back(entry->path());
      }
    }
    return found;
  }

  std::string folder_ = "/tmp/sightline-kept-files-XXXXXX";
  std::string spool_;
  std::unique_ptr<RenderServer> server_;
  std::unique_ptr<v1::RenderService::Stub> render_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

// Also where the user lets everybody read new files.
TEST_F(KeptFilesTest, AreReadableByTheirUserOnly) {
  const mode_t old_mask = umask(0);
  const auto restore = absl::MakeCleanup([&] { umask(old_mask); });
  Start(absl::Hours(1));
  Upload("a part");
  Render();
  const auto assets = Named("asset-");
  ASSERT_EQ(assets.size(), 1u);
  EXPECT_EQ(fs::status(assets[0]).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  const auto outputs = Named("job-");
  ASSERT_EQ(outputs.size(), 1u);
  EXPECT_EQ(fs::status(outputs[0]).permissions(), fs::perms::owner_all);
  // All of it is in one folder, into which nobody else comes.
  ASSERT_EQ(std::distance(fs::directory_iterator(spool_), fs::directory_iterator()), 1);
  EXPECT_EQ(fs::directory_iterator(spool_)->status().permissions(), fs::perms::owner_all);
}

TEST_F(KeptFilesTest, GoAfterTheirTime) {
  Start(absl::Milliseconds(500));
  Upload("a part");
  const std::string job = Render();
  WaitUntil([&] { return Named("asset-").empty() && Named("job-").empty(); });
  grpc::ClientContext context;
  context.set_deadline(FarDeadline());
  v1::StreamRenderFilesRequest request;
  request.set_job_id(job);
  auto reader = render_->StreamRenderFiles(&context, request);
  v1::StreamRenderFilesResponse response;
  while (reader->Read(&response)) {
  }
  const absl::Status status = FromGrpcStatus(reader->Finish());
  EXPECT_EQ(ErrorReason(status), "JOB_UNKNOWN") << status;
}

TEST_F(KeptFilesTest, AnAssetInUseStaysUntilItsUserIsDone) {
  AssetStore store(spool_, 1 << 20);
  const auto digest = store.Put("a part");
  ASSERT_TRUE(digest.ok()) << digest.status();
  auto held = store.Get(*digest);
  ASSERT_NE(held, nullptr);
  store.DropUnused(absl::Hours(1));
  EXPECT_EQ(store.Get(*digest), held);
  store.DropUnused(absl::ZeroDuration());
  EXPECT_EQ(store.Get(*digest), nullptr);
  EXPECT_EQ(store.bytes(), 0);
  EXPECT_TRUE(fs::exists(held->path()));
  held.reset();
  EXPECT_TRUE(Named("asset-").empty());
}

TEST_F(KeptFilesTest, ImagesStayWhileTheirJobRuns) {
  RenderOutputStore store(1 << 20, absl::ZeroDuration());
  const auto output = std::make_shared<RenderOutput>(spool_ + "/job-1");
  ASSERT_TRUE(output->MakeFolder().ok());
  store.Add("render-1", output);
  store.Trim();
  EXPECT_EQ(store.Get("render-1"), output);
  output->Finish();
  store.Trim();
  EXPECT_EQ(store.Get("render-1"), nullptr);
  output->RemoveFolder();
}

}  // namespace
}  // namespace sightline
