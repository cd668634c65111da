// SPDX-License-Identifier: Apache-2.0
// Render workers as processes whose disk is full, whose queue is full, or who are killed.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "core/status/status_macros.h"
#include "planner_client/embedded_server/embedded_server.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "sightline/v1/render_service.grpc.pb.h"
#include "tests/integration/run_process.h"
#include "tests/limits/wait_until.h"
#include "tests/render_worker/service/plate_spec.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

int64_t MemoryBytes(pid_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/statm"));
  int64_t size = 0, resident = 0;
  file >> size >> resident;
  return resident * sysconf(_SC_PAGESIZE);
}

class RenderFaultTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    spool_ = folder_ + "/spool";
    fs::create_directories(spool_);
  }
  void TearDown() override {
    server_.reset();
    if (mounted_) umount(spool_.c_str());
    fs::remove_all(folder_);
  }

  void Start(std::vector<std::string> arguments = {}) {
    EmbeddedServerOptions options;
    options.binary = BinFolder() + "/render_worker";
    options.arguments = {"--threads", "1", "--spool", spool_};
    options.arguments.insert(options.arguments.end(), arguments.begin(), arguments.end());
    auto server = EmbeddedServer::Start(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    grpc::ChannelArguments channel;
    channel.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    channel_ =
        grpc::CreateCustomChannel(server_->address(), grpc::InsecureChannelCredentials(), channel);
    render_ = v1::RenderService::NewStub(channel_);
    jobs_ = v1::JobService::NewStub(channel_);
  }

  static void SetTimeout(grpc::ClientContext* context) { context->set_deadline(FarDeadline()); }
  absl::StatusOr<v1::Job> Create(const v1::RenderSpec& spec) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::CreateRenderRequest request;
    *request.mutable_spec() = spec;
    v1::CreateRenderResponse response;
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(render_->CreateRender(&context, request, &response)));
    return response.job();
  }
  void Cancel(const std::string& job_id) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::CancelJobRequest request;
    request.set_job_id(job_id);
    v1::CancelJobResponse response;
    EXPECT_TRUE(jobs_->CancelJob(&context, request, &response).ok());
  }
  // Files and their bytes, until the job ends.
  absl::Status Stream(const std::string& job_id, std::map<std::string, std::string>* files) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::StreamRenderFilesRequest request;
    request.set_job_id(job_id);
    auto reader = render_->StreamRenderFiles(&context, request);
    v1::StreamRenderFilesResponse response;
    std::string name;
    while (reader->Read(&response)) {
      if (response.has_header()) {
        name = response.header().file();
        (*files)[name] = "";
      } else if (!response.chunk().empty()) {
        (*files)[name] += response.chunk();
      }
    }
    return FromGrpcStatus(reader->Finish());
  }
  // Names in the folder that the worker has made in the spool.
  std::vector<std::string> Spooled() const {
    std::vector<std::string> names;
    for (const auto& folder : fs::directory_iterator(spool_)) {
      if (!folder.is_directory()) continue;
      for (const auto& entry : fs::directory_iterator(folder)) {
        if (entry.path().filename() != ".lock") names.push_back(entry.path().filename());
      }
    }
    return names;
  }
  int Folders() const {
    int count = 0;
    for (const auto& entry : fs::directory_iterator(spool_)) count += entry.is_directory();
    return count;
  }

  std::string folder_ = "/tmp/sightline-render-fault-XXXXXX";
  std::string spool_;
  bool mounted_ = false;
  std::unique_ptr<EmbeddedServer> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::RenderService::Stub> render_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

// The error names only the client's own files.
void ExpectFullDisk(const absl::Status& status, const std::string& spool) {
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr(spool)));
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("/tmp/")));
}

TEST_F(RenderFaultTest, FileTooLargeForTheDisk) {
  Start();
  // Images have about 6 kB, recordings.json of forty of them much more.
  const v1::RenderSpec spec = PlateSpec(40);
  ASSERT_GT(server_->pid(), 1);
  rlimit before{};
  ASSERT_EQ(prlimit(server_->pid(), RLIMIT_FSIZE, nullptr, &before), 0);
  const auto limit = [&](rlim_t bytes) {
    const rlimit lowered = {bytes, before.rlim_max};
    ASSERT_EQ(prlimit(server_->pid(), RLIMIT_FSIZE, &lowered, nullptr), 0);
  };
  std::map<std::string, std::string> files;
  limit(10000);
  auto job = Create(spec);
  ASSERT_TRUE(job.ok()) << job.status();
  const absl::Status description = Stream(job->job_id(), &files);
  ExpectFullDisk(description, spool_);
  EXPECT_THAT(std::string(description.message()), HasSubstr("recordings.json: cannot be written"));
  EXPECT_EQ(files.size(), 40u) << "what is whole was sent";
  EXPECT_EQ(files.count("recordings.json"), 0u);

  files.clear();
  limit(1000);
  job = Create(spec);
  ASSERT_TRUE(job.ok()) << job.status();
  const absl::Status image = Stream(job->job_id(), &files);
  ExpectFullDisk(image, spool_);
  EXPECT_THAT(std::string(image.message()), HasSubstr("images/0.png"));
  EXPECT_TRUE(files.empty()) << "nothing half-written is shown";

  // An upload that cannot be kept.
  {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::UploadAssetResponse response;
    auto writer = render_->UploadAsset(&context, &response);
    v1::UploadAssetRequest message;
    message.mutable_header()->set_size_bytes(5000);
    writer->Write(message);
    message.set_chunk(std::string(5000, 'x'));
    writer->Write(message);
    writer->WritesDone();
    ExpectFullDisk(FromGrpcStatus(writer->Finish()), spool_);
  }

  files.clear();
  limit(before.rlim_cur);
  job = Create(spec);
  ASSERT_TRUE(job.ok()) << job.status();
  const absl::Status done = Stream(job->job_id(), &files);
  EXPECT_TRUE(done.ok()) << done;
  EXPECT_EQ(files.size(), 41u);
}

TEST_F(RenderFaultTest, FullDisk) {
  if (mount("tmpfs", spool_.c_str(), "tmpfs", 0, "size=128k") != 0) {
    GTEST_SKIP() << "only root may mount a small disk; FileTooLargeForTheDisk stands for it";
  }
  mounted_ = true;
  Start();
  std::map<std::string, std::string> files;
  auto job = Create(PlateSpec(60));
  ASSERT_TRUE(job.ok()) << job.status();
  const absl::Status full = Stream(job->job_id(), &files);
  ExpectFullDisk(full, spool_);
  EXPECT_THAT(std::string(full.message()), HasSubstr("No space left"));
  EXPECT_LT(files.size(), 60u);
  for (const auto& [name, bytes] : files) EXPECT_GT(bytes.size(), 1000u) << name;
  ASSERT_EQ(mount("tmpfs", spool_.c_str(), "tmpfs", MS_REMOUNT, "size=8m"), 0);
  files.clear();
  job = Create(PlateSpec(60));
  ASSERT_TRUE(job.ok()) << job.status();
  const absl::Status done = Stream(job->job_id(), &files);
  EXPECT_TRUE(done.ok()) << done;
  EXPECT_EQ(files.size(), 61u);
}

// About 2 MB of a request that takes a long time.
v1::RenderSpec LargeSpec() {
  v1::RenderSpec spec = PlateSpec(9000);
  return spec;
}

TEST_F(RenderFaultTest, TheQueueIsBoundedAndLeavesNothing) {
  Start({"--max-queued-bytes", "200MB"});
  ASSERT_GT(server_->pid(), 1);
  const v1::RenderSpec spec = LargeSpec();
  EXPECT_GT(spec.ByteSizeLong(), 1000000u);
  std::vector<std::string> accepted;
  int refused = 0;
  for (int i = 0; i < 150; ++i) {
    const auto job = Create(spec);
    if (job.ok()) {
      accepted.push_back(job->job_id());
      continue;
    }
    ++refused;
    EXPECT_EQ(job.status().code(), absl::StatusCode::kResourceExhausted) << job.status();
    EXPECT_EQ(ErrorReason(job.status()), "QUEUE_FULL");
    EXPECT_THAT(std::string(job.status().message()), HasSubstr("the queue is full"));
  }
  std::printf("%zu accepted, %d refused, %lld MB resident\n", accepted.size(), refused,
              static_cast<long long>(MemoryBytes(server_->pid()) >> 20));
  EXPECT_GE(accepted.size(), 5u);
  EXPECT_LE(accepted.size(), 64u);
  EXPECT_GT(refused, 0);
  EXPECT_LT(MemoryBytes(server_->pid()), int64_t{700} << 20);
  EXPECT_LE(Spooled().size(), 2u) << "only the job that runs has a folder";
  for (const std::string& job : accepted) Cancel(job);
  WaitUntil([&] { return Spooled().empty(); });
  // The queue takes jobs again.
  const auto job = Create(PlateSpec(2));
  ASSERT_TRUE(job.ok()) << job.status();
  std::map<std::string, std::string> files;
  EXPECT_TRUE(Stream(job->job_id(), &files).ok());
  EXPECT_EQ(files.size(), 3u);
}

TEST_F(RenderFaultTest, TheNextWorkerCleansUpAfterOneThatWasKilled) {
  // Folders of others: one with another name, one that is in use.
  fs::create_directories(spool_ + "/mine");
  Start();
  auto other = std::move(server_);
  Start();
  EXPECT_EQ(Folders(), 3) << "both workers' and mine";
  const auto job = Create(LargeSpec());
  ASSERT_TRUE(job.ok()) << job.status();
  WaitUntil([&] { return !Spooled().empty(); });
  ASSERT_GT(server_->pid(), 1);
  ASSERT_EQ(kill(server_->pid(), SIGKILL), 0);
  WaitUntil([&] { return !server_->CheckAlive().ok(); });
  EXPECT_EQ(Folders(), 3);
  Start();
  EXPECT_EQ(Folders(), 3) << "that of the killed worker went, that of the new one came";
  EXPECT_THAT(Spooled(), ::testing::IsEmpty());
  EXPECT_TRUE(other->CheckAlive().ok());
  EXPECT_TRUE(fs::exists(spool_ + "/mine"));
  // Two signals end a worker at once; its folder goes all the same.
  ASSERT_TRUE(Create(LargeSpec()).ok());
  const pid_t pid = server_->pid();
  ASSERT_GT(pid, 1);
  ASSERT_EQ(kill(pid, SIGTERM), 0);
  kill(pid, SIGTERM);
  WaitUntil([&] { return !server_->CheckAlive().ok(); });
  EXPECT_EQ(Folders(), 2);
}

}  // namespace
}  // namespace sightline
