// SPDX-License-Identifier: Apache-2.0
// How long clients wait: no call that does work has a deadline, however it is made.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "planner_client/rpc_client/answer_job.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/coverage_service.grpc.pb.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "sightline/v1/render_service.grpc.pb.h"

namespace sightline {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::Key;
using ::testing::Pair;

// Records the calls that came, and whether they had a deadline.
class CallLog {
 public:
  void Add(const std::string& method, const grpc::ServerContext& context) {
    const std::lock_guard lock(mutex_);
    has_deadline_[method] |= context.deadline() != std::chrono::system_clock::time_point::max();
  }
  std::map<std::string, bool> has_deadline() const {
    const std::lock_guard lock(mutex_);
    return has_deadline_;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, bool> has_deadline_;
};

// The job is not finished when it is made, so that it is watched.
v1::Job JobIn(v1::Job::State state) {
  v1::Job job;
  job.set_job_id("job");
  job.set_result_key("scene");
  job.set_state(state);
  return job;
}

grpc::Status Refusal() { return {grpc::StatusCode::INVALID_ARGUMENT, "not asked for here"}; }

// One scene with one target; other calls are noted and refused.
class OneScene final : public v1::CoverageService::Service {
 public:
  explicit OneScene(CallLog* log) : log_(log) {}
  grpc::Status CreateScene(grpc::ServerContext* context, const v1::CreateSceneRequest*,
                           v1::CreateSceneResponse* response) override {
    log_->Add("CreateScene", *context);
    *response->mutable_job() = JobIn(v1::Job::STATE_RUNNING);
    return grpc::Status::OK;
  }
  grpc::Status GetScene(grpc::ServerContext* context, const v1::GetSceneRequest*,
                        v1::GetSceneResponse* response) override {
    log_->Add("GetScene", *context);
    response->set_target_count(1);
    response->set_measurable_count(1);
    return grpc::Status::OK;
  }
  grpc::Status StreamTargets(grpc::ServerContext* context, const v1::StreamTargetsRequest*,
                             grpc::ServerWriter<v1::StreamTargetsResponse>* writer) override {
    log_->Add("StreamTargets", *context);
    v1::StreamTargetsResponse response;
    for (int i = 0; i < 3; ++i) {
      response.add_positions_m(0);
      response.add_normals(0);
    }
    response.add_measurable(true);
    response.add_regions(-1);
    writer->Write(response);
    return grpc::Status::OK;
  }
  grpc::Status EvaluateGains(grpc::ServerContext* context, const v1::EvaluateGainsRequest*,
                             v1::EvaluateGainsResponse*) override {
    log_->Add("EvaluateGains", *context);
    return Refusal();
  }
  grpc::Status EvaluateCoverage(grpc::ServerContext* context, const v1::EvaluateCoverageRequest*,
                                v1::EvaluateCoverageResponse*) override {
    log_->Add("EvaluateCoverage", *context);
    return Refusal();
  }
  grpc::Status EvaluateUncertainty(grpc::ServerContext* context,
                                   const v1::EvaluateUncertaintyRequest*,
                                   grpc::ServerWriter<v1::EvaluateUncertaintyResponse>*) override {
    log_->Add("EvaluateUncertainty", *context);
    return Refusal();
  }
  grpc::Status StreamMeasurementPoints(
      grpc::ServerContext* context, const v1::StreamMeasurementPointsRequest*,
      grpc::ServerWriter<v1::StreamMeasurementPointsResponse>*) override {
    log_->Add("StreamMeasurementPoints", *context);
    return Refusal();
  }
  grpc::Status ExplainTargets(grpc::ServerContext* context, const v1::ExplainTargetsRequest*,
                              v1::ExplainTargetsResponse*) override {
    log_->Add("ExplainTargets", *context);
    return Refusal();
  }
  grpc::Status RenderView(grpc::ServerContext* context, const v1::RenderViewRequest*,
                          v1::RenderViewResponse*) override {
    log_->Add("RenderView", *context);
    return Refusal();
  }

 private:
  CallLog* const log_;
};

class OneJob final : public v1::JobService::Service {
 public:
  explicit OneJob(CallLog* log) : log_(log) {}
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest*,
                        grpc::ServerWriter<v1::WatchJobResponse>* writer) override {
    log_->Add("WatchJob", *context);
    v1::WatchJobResponse response;
    *response.mutable_job() = JobIn(v1::Job::STATE_SUCCEEDED);
    writer->Write(response);
    return grpc::Status::OK;
  }

 private:
  CallLog* const log_;
};

class WaitingTest : public ::testing::Test {
 protected:
  void SetUp() override {
    grpc::ServerBuilder builder;
    int port = 0;
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&scene_);
    builder.RegisterService(&job_);
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    address_ = absl::StrCat("127.0.0.1:", port);
  }

  CallLog log_;
  OneScene scene_{&log_};
  OneJob job_{&log_};
  std::unique_ptr<grpc::Server> server_;
  std::string address_;
};

TEST_F(WaitingTest, CoverageClientsSetNoDeadline) {
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->positions_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh->triangles.push_back({0, 1, 2});
  CoverageClientOptions options;
  options.address = address_;
  CoverageTask task;
  task.part = mesh;
  auto client = CoverageClient::Open(options, task);
  ASSERT_TRUE(client.ok()) << client.status();
  const std::vector<Measurement> one(1);
  const std::vector<uint32_t> target = {0};
  // A further call of the client joins with a line.
  const std::vector<std::pair<std::string, std::function<absl::Status()>>> calls = {
      {"EvaluateGains", [&] { return (*client)->Gains(one, {}).status(); }},
      {"EvaluateCoverage", [&] { return (*client)->FastCoverage(one).status(); }},
      {"EvaluateCoverage", [&] { return (*client)->ExactCoverage(one).status(); }},
      {"EvaluateUncertainty",
       [&] { return (*client)->Uncertainties(one, {}, false, {}).status(); }},
      {"StreamMeasurementPoints", [&] { return (*client)->MeasurementPoints(one[0]).status(); }},
      {"ExplainTargets", [&] { return (*client)->ExplainTargets(target).status(); }},
      {"RenderView", [&] { return (*client)->RenderView({}).status(); }},
  };
  for (const auto& [method, call] : calls) {
    EXPECT_TRUE(absl::IsInvalidArgument(call())) << method;
    EXPECT_THAT(log_.has_deadline(), Contains(Key(method)));
  }
  for (const char* method : {"CreateScene", "WatchJob", "GetScene", "StreamTargets"}) {
    EXPECT_THAT(log_.has_deadline(), Contains(Key(method)));
  }
  EXPECT_THAT(log_.has_deadline(), Each(Pair(testing::_, false)));
}

TEST_F(WaitingTest, JobsOfWorkersHaveNoDeadline) {
  WorkerClientOptions options;
  options.address = address_;
  int reports = 0;
  options.on_progress = [&](double, const std::string&) { ++reports; };
  const std::vector<AssetFile> no_assets;
  WorkerCall call(options, no_assets);
  const auto service = v1::CoverageService::NewStub(call.channel());
  // Any call that answers with a job.
  v1::CreateSceneResponse created;
  v1::GetSceneResponse answer;
  const absl::Status status = RunAnswerJob(
      &call, created,
      [&](grpc::ClientContext* context) { return service->CreateScene(context, {}, &created); },
      [&](grpc::ClientContext* context) { return service->GetScene(context, {}, &answer); });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_GE(reports, 1);
  for (const char* method : {"CreateScene", "WatchJob", "GetScene"}) {
    EXPECT_THAT(log_.has_deadline(), Contains(Pair(std::string(method), false)));
  }
}

}  // namespace
}  // namespace sightline
