// SPDX-License-Identifier: Apache-2.0
// The gRPC front end, called by clients of two names; a test stands in for the runner.
#include "planning_service/grpc_api/planning_service.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>

#include "core/digest/sha256.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "rpc_server/server_metrics.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

v1::PlanningTask PlanTask() {
  v1::PlanningTask task;
  task.set_kind("plan");
  task.mutable_inspection()->mutable_part()->set_file("part.glb");
  return task;
}

class PlanningServiceTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string folder = (fs::temp_directory_path() / "sightline-service-XXXXXX").string();
    ASSERT_NE(mkdtemp(folder.data()), nullptr);
    folder_ = folder;
    std::ofstream(folder_ + "/clients.json")
        << R"({"clients": [{"name": "mes", "token_sha256": ")" << Sha256Hex("mes-token-0123456789")
        << R"(", "kinds": ["plan", "evaluate"], "max_queued_jobs": 3},
               {"name": "lab", "token_sha256": ")"
        << Sha256Hex("lab-token-0123456789") << R"(", "operator": true, "max_priority": 5}]})";
    auto access = ReadClientAccess(folder_ + "/clients.json");
    ASSERT_TRUE(access.ok()) << access.status();
    access_ = *std::move(access);
    auto store = OpenSqliteJobStore(folder_ + "/jobs.sqlite");
    ASSERT_TRUE(store.ok()) << store.status();
    store_ = *std::move(store);
    auto artefacts = ArtefactStore::Open(folder_ + "/artefacts", 0);
    ASSERT_TRUE(artefacts.ok()) << artefacts.status();
    artefacts_ = *std::move(artefacts);
    jobs_ = std::make_unique<PlanningJobs>(store_.get(), artefacts_.get());
    calls_ = std::make_unique<CallTracker>(&metrics_);
    service_ = std::make_unique<PlanningServiceImpl>(jobs_.get(), access_.get(), calls_.get());
    grpc::ServerBuilder builder;
    builder.AddListeningPort("unix:" + folder_ + "/socket", grpc::InsecureServerCredentials());
    builder.RegisterService(service_.get());
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    stub_ = v1::PlanningService::NewStub(
        grpc::CreateChannel("unix:" + folder_ + "/socket", grpc::InsecureChannelCredentials()));
  }
  void TearDown() override {
    server_->Shutdown();
    fs::remove_all(folder_);
  }

  static std::unique_ptr<grpc::ClientContext> As(const std::string& token) {
    auto context = std::make_unique<grpc::ClientContext>();
    context->set_deadline(FarDeadline());
    if (!token.empty()) context->AddMetadata("authorization", "Bearer " + token);
    return context;
  }

  absl::StatusOr<std::string> Upload(const std::string& bytes, const std::string& token,
                                     const std::string& digest = "") {
    const auto context = As(token);
    v1::UploadFileResponse response;
    auto writer = stub_->UploadFile(context.get(), &response);
    v1::UploadFileRequest request;
    request.mutable_header()->set_size_bytes(static_cast<int64_t>(bytes.size()));
    request.mutable_header()->set_digest(digest);
    writer->Write(request);
    for (size_t i = 0; i < bytes.size(); i += 1000) {
      request.set_chunk(bytes.substr(i, 1000));
      writer->Write(request);
    }
    writer->WritesDone();
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(writer->Finish()));
    return response.digest();
  }

  absl::StatusOr<v1::PlanningJob> Create(const std::string& digest, const std::string& request_id,
                                         const std::string& token = kMes,
                                         const v1::PlanningTask& task = PlanTask(),
                                         int priority = 0) {
    const auto context = As(token);
    v1::CreatePlanningJobRequest request;
    request.set_request_id(request_id);
    *request.mutable_task() = task;
    request.set_priority(priority);
    if (!digest.empty()) {
      request.add_files()->set_name("part.glb");
      request.mutable_files(0)->set_digest(digest);
    }
    v1::CreatePlanningJobResponse response;
    SIGHTLINE_RETURN_IF_ERROR(
        FromGrpcStatus(stub_->CreatePlanningJob(context.get(), request, &response)));
    return response.job();
  }

  absl::StatusOr<v1::PlanningJob> Get(const std::string& job_id, const std::string& token = kMes) {
    const auto context = As(token);
    v1::GetPlanningJobRequest request;
    request.set_job_id(job_id);
    v1::GetPlanningJobResponse response;
    SIGHTLINE_RETURN_IF_ERROR(
        FromGrpcStatus(stub_->GetPlanningJob(context.get(), request, &response)));
    return response.job();
  }

  // Completes a job as the runner would.
  void Succeed(const std::string& bytes) {
    auto job = store_->Claim([this](const std::string& name) { return access_->QuotaOf(name); });
    ASSERT_TRUE(job.ok() && job->has_value());
    std::ofstream(folder_ + "/result") << bytes;
    auto added = artefacts_->AddFile(folder_ + "/result");
    ASSERT_TRUE(added.ok());
    ASSERT_TRUE(store_
                    ->Succeed({(*job)->job_id, (*job)->attempts},
                              {{"plan.json", added->digest, added->size_bytes}})
                    .ok());
  }

  absl::StatusOr<std::string> Result(const std::string& job_id, const std::string& name,
                                     int64_t offset, const std::string& token = kMes) {
    const auto context = As(token);
    v1::StreamResultRequest request;
    request.set_job_id(job_id);
    request.set_name(name);
    request.set_offset(offset);
    auto reader = stub_->StreamResult(context.get(), request);
    v1::StreamResultResponse response;
    std::string bytes;
    while (reader->Read(&response)) bytes += response.chunk();
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(reader->Finish()));
    return bytes;
  }

  static constexpr char kMes[] = "mes-token-0123456789";
  static constexpr char kLab[] = "lab-token-0123456789";
  std::string folder_;
  ServerMetrics metrics_;
  std::unique_ptr<ClientAccess> access_;
  std::unique_ptr<PlanningJobStore> store_;
  std::unique_ptr<ArtefactStore> artefacts_;
  std::unique_ptr<PlanningJobs> jobs_;
  std::unique_ptr<CallTracker> calls_;
  std::unique_ptr<PlanningServiceImpl> service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<v1::PlanningService::Stub> stub_;
};

TEST_F(PlanningServiceTest, FromUploadToResult) {
  const std::string part(5000, 'p');
  const auto digest = Upload(part, kMes, Sha256Hex(part));
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(*digest, Sha256Hex(part));
  const auto job = Create(*digest, "order-1");
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->state(), v1::PlanningJob::QUEUED);
  EXPECT_EQ(job->client(), "mes");
  EXPECT_EQ(ErrorReason(Result(job->job_id(), "plan.json", 0).status()), "JOB_NOT_FINISHED");

  std::vector<v1::PlanningJob::State> states;
  std::thread watcher([&] {
    const auto context = As(kMes);
    v1::WatchPlanningJobRequest request;
    request.set_job_id(job->job_id());
    auto reader = stub_->WatchPlanningJob(context.get(), request);
    v1::WatchPlanningJobResponse response;
    while (reader->Read(&response)) states.push_back(response.job().state());
    EXPECT_TRUE(reader->Finish().ok());
  });
  Succeed("a plan");
  watcher.join();
  EXPECT_EQ(states.back(), v1::PlanningJob::SUCCEEDED);
  EXPECT_EQ(*Result(job->job_id(), "plan.json", 0), "a plan");
  EXPECT_EQ(*Result(job->job_id(), "plan.json", 2), "plan");
  EXPECT_EQ(ErrorReason(Result(job->job_id(), "no.json", 0).status()), "RESULT_UNKNOWN");
  EXPECT_TRUE(absl::IsInvalidArgument(Result(job->job_id(), "plan.json", 7).status()));
}

TEST_F(PlanningServiceTest, ARequestIsDoneOnce) {
  const auto digest = Upload("part", kMes);
  const auto first = Create(*digest, "order-1");
  const auto again = Create(*digest, "order-1");
  ASSERT_TRUE(first.ok() && again.ok());
  EXPECT_EQ(first->job_id(), again->job_id());
  v1::PlanningTask other = PlanTask();
  other.set_seed(2);
  const auto reused = Create(*digest, "order-1", kMes, other);
  EXPECT_TRUE(absl::IsAlreadyExists(reused.status()));
  EXPECT_EQ(ErrorReason(reused.status()), "REQUEST_ID_REUSED");
}

TEST_F(PlanningServiceTest, ClientsDoNotSeeEachOther) {
  const auto digest = Upload("the part of the mes", kMes);
  const auto job = Create(*digest, "");
  ASSERT_TRUE(job.ok());
  // Another client's file and job are as unknown as those that never were.
  std::ofstream(folder_ + "/clients.json")
      << R"({"clients": [{"name": "mes", "token_sha256": ")" << Sha256Hex(kMes)
      << R"("}, {"name": "lab", "token_sha256": ")" << Sha256Hex(kLab) << R"("}]})";
  auto access = ReadClientAccess(folder_ + "/clients.json");
  ASSERT_TRUE(access.ok());
  const Client lab = *(*access)->Identify({{}, kLab});
  EXPECT_EQ(ErrorReason(jobs_->Get(lab, job->job_id()).status()), "JOB_UNKNOWN");
  EXPECT_EQ(ErrorReason(jobs_->Create(lab, "", PlanTask(), {{"part.glb", *digest, 0}}, 0).status()),
            "FILE_UNKNOWN");
  EXPECT_TRUE(jobs_->List(lab, {})->jobs.empty());
  EXPECT_EQ(Get("job-none").status().message(),
            FromGrpcStatus(ToGrpcStatus(jobs_->Get(lab, "job-none").status())).message());
  // An operator sees and cancels all.
  EXPECT_TRUE(Get(job->job_id(), kLab).ok());
}

TEST_F(PlanningServiceTest, WhoIsUnknownOrMayNotIsRefused) {
  EXPECT_TRUE(absl::IsUnauthenticated(Get("job-1", "").status()));
  EXPECT_TRUE(absl::IsUnauthenticated(Get("job-1", "wrong-token-0123456789").status()));
  v1::PlanningTask optics = PlanTask();
  optics.set_kind("optics");
  const auto digest = Upload("part", kMes);
  const auto refused = Create(*digest, "", kMes, optics);
  EXPECT_TRUE(absl::IsPermissionDenied(refused.status()));
  EXPECT_EQ(ErrorReason(refused.status()), "KIND_NOT_ALLOWED");
  EXPECT_EQ(FieldViolations(Create(*digest, "", kMes, PlanTask(), 1).status())[0].field,
            "priority");
}

TEST_F(PlanningServiceTest, QuotasHold) {
  const auto digest = Upload("part", kMes);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(Create(*digest, "").ok());
  const auto refused = Create(*digest, "");
  EXPECT_TRUE(absl::IsResourceExhausted(refused.status())) << refused.status();
  EXPECT_EQ(ErrorReason(refused.status()), "QUOTA_EXCEEDED");
}

// Bytes of all files below a folder.
int64_t BytesIn(const std::string& folder) {
  int64_t sum = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) sum += static_cast<int64_t>(entry.file_size());
  }
  return sum;
}

TEST_F(PlanningServiceTest, RefusedUploadsTakeNoRoom) {
  Client client;
  client.name = "mes";
  client.quota.max_stored_bytes = 20'000;
  const auto upload = [&](const std::string& bytes) -> absl::StatusOr<JobFile> {
    SIGHTLINE_ASSIGN_OR_RETURN(FileUpload file, jobs_->Upload(client));
    for (size_t i = 0; i < bytes.size(); i += 1000) {
      SIGHTLINE_RETURN_IF_ERROR(file.Write(bytes.substr(i, 1000)));
      EXPECT_LE(BytesIn(folder_ + "/artefacts"), client.quota.max_stored_bytes);
    }
    return file.Finish("");
  };
  const std::string first(12'000, 'a');
  ASSERT_TRUE(upload(first).ok());
  for (int i = 0; i < 5; ++i) {
    const absl::Status refused = upload(std::string(12'000, static_cast<char>('b' + i))).status();
    EXPECT_EQ(ErrorReason(refused), "QUOTA_EXCEEDED") << refused;
  }
  EXPECT_EQ(BytesIn(folder_ + "/artefacts"), 12'000);
  // A file that the client has already takes no more room.
  const auto again = upload(first);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->digest, Sha256Hex(first));
  EXPECT_TRUE(artefacts_->Has(again->digest));
}

TEST_F(PlanningServiceTest, UploadsUnderWayCountTogether) {
  Client client;
  client.name = "mes";
  client.quota.max_stored_bytes = 10'000;
  {
    std::vector<FileUpload> uploads;
    for (int i = 0; i < 4; ++i) uploads.push_back(*jobs_->Upload(client));
    for (FileUpload& upload : uploads) {
      ASSERT_TRUE(upload.Write(std::string(4000, static_cast<char>('a' + uploads.size()))).ok());
    }
    EXPECT_LE(BytesIn(folder_ + "/artefacts"), client.quota.max_stored_bytes);
  }
  // Uploads that were broken off count no more.
  absl::StatusOr<FileUpload> alone = jobs_->Upload(client);
  ASSERT_TRUE(alone.ok() && alone->Write(std::string(9000, 'z')).ok());
  EXPECT_TRUE(alone->Finish("").ok());
}

TEST_F(PlanningServiceTest, BrokenUploadsAreRefused) {
  EXPECT_EQ(ErrorReason(Upload("bytes", kMes, Sha256Hex("other")).status()), "DIGEST_MISMATCH");
  const auto context = As(kMes);
  v1::UploadFileResponse response;
  auto writer = stub_->UploadFile(context.get(), &response);
  v1::UploadFileRequest request;
  request.mutable_header()->set_size_bytes(100);
  writer->Write(request);
  request.set_chunk("only a few");
  writer->Write(request);
  writer->WritesDone();
  EXPECT_TRUE(absl::IsInvalidArgument(FromGrpcStatus(writer->Finish())));
}

TEST_F(PlanningServiceTest, PagesOfJobs) {
  const auto digest = Upload("part", kLab);
  std::vector<std::string> made;
  for (int i = 0; i < 7; ++i) made.push_back(Create(*digest, "", kLab)->job_id());
  std::reverse(made.begin(), made.end());
  std::vector<std::string> listed;
  v1::ListPlanningJobsRequest request;
  request.set_page_size(3);
  do {
    const auto context = As(kLab);
    v1::ListPlanningJobsResponse response;
    ASSERT_TRUE(stub_->ListPlanningJobs(context.get(), request, &response).ok());
    EXPECT_LE(response.jobs_size(), 3);
    for (const v1::PlanningJob& job : response.jobs()) listed.push_back(job.job_id());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty() && listed.size() < 20);
  EXPECT_EQ(listed, made);
}

TEST_F(PlanningServiceTest, RecipesArePreparedOnceAndStartedOften) {
  const auto digest = Upload("part", kMes);
  v1::PrepareRecipeRequest prepare;
  prepare.set_recipe_id("head, side A");
  *prepare.mutable_task() = PlanTask();
  prepare.add_files()->set_name("part.glb");
  prepare.mutable_files(0)->set_digest(*digest);
  v1::PrepareRecipeResponse prepared;
  ASSERT_TRUE(stub_->PrepareRecipe(As(kMes).get(), prepare, &prepared).ok());
  EXPECT_EQ(prepared.digest().size(), 64u);
  v1::GetVisionStateResponse state;
  ASSERT_TRUE(stub_->GetVisionState(As(kMes).get(), {}, &state).ok());
  EXPECT_EQ(state.state(), v1::GetVisionStateResponse::READY);

  v1::StartJobRequest start;
  start.set_recipe_id("head, side A");
  start.set_request_id("run-1");
  v1::StartJobResponse first, again;
  ASSERT_TRUE(stub_->StartJob(As(kMes).get(), start, &first).ok());
  ASSERT_TRUE(stub_->StartJob(As(kMes).get(), start, &again).ok());
  EXPECT_EQ(first.job().job_id(), again.job().job_id());
  v1::GetResultByIdRequest by_id;
  by_id.set_job_id(first.job().job_id());
  v1::GetResultByIdResponse result;
  EXPECT_EQ(ErrorReason(FromGrpcStatus(stub_->GetResultById(As(kMes).get(), by_id, &result))),
            "JOB_NOT_FINISHED");
  Succeed("a plan");
  ASSERT_TRUE(stub_->GetResultById(As(kMes).get(), by_id, &result).ok());
  EXPECT_EQ(result.job().results(0).name(), "plan.json");

  v1::UnprepareRecipeRequest unprepare;
  unprepare.set_recipe_id("head, side A");
  v1::UnprepareRecipeResponse none;
  ASSERT_TRUE(stub_->UnprepareRecipe(As(kMes).get(), unprepare, &none).ok());
  start.set_request_id("run-2");
  EXPECT_EQ(ErrorReason(FromGrpcStatus(stub_->StartJob(As(kMes).get(), start, &first))),
            "RECIPE_UNKNOWN");
}

// When the task is submitted, from whatever piece of the file.
TEST_F(PlanningServiceTest, AStepFileWithoutUnitIsRefused) {
  const std::string text = "ISO-10303-21;\nDATA;\n" + std::string(3 << 20, '\n') +
                           "#1=PRODUCT('p','p','',());\nENDSEC;\nEND-ISO-10303-21;\n";
  const auto digest = Upload(text, kMes);
  ASSERT_TRUE(digest.ok()) << digest.status();
  v1::CreatePlanningJobRequest request;
  *request.mutable_task() = PlanTask();
  request.mutable_task()->mutable_inspection()->mutable_part()->set_file("part.stp");
  request.add_files()->set_name("part.stp");
  request.mutable_files(0)->set_digest(*digest);
  v1::CreatePlanningJobResponse response;
  const absl::Status refused =
      FromGrpcStatus(stub_->CreatePlanningJob(As(kMes).get(), request, &response));
  EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
  ASSERT_FALSE(FieldViolations(refused).empty());
  EXPECT_EQ(FieldViolations(refused)[0].field, "inspection.part.unit");
  request.mutable_task()->mutable_inspection()->mutable_part()->set_unit("mm");
  EXPECT_TRUE(stub_->CreatePlanningJob(As(kMes).get(), request, &response).ok());
}

TEST_F(PlanningServiceTest, APlanOfAnEarlierJobIsTaken) {
  const auto digest = Upload("part", kMes);
  const auto plan = Create(*digest, "");
  v1::PlanningTask evaluate = PlanTask();
  evaluate.set_kind("evaluate");
  evaluate.set_plan_job_id(plan->job_id());
  EXPECT_EQ(ErrorReason(Create(*digest, "", kMes, evaluate).status()), "JOB_NOT_FINISHED");
  Succeed("{}");
  const auto made = Create(*digest, "", kMes, evaluate);
  ASSERT_TRUE(made.ok()) << made.status();
  const auto kept = store_->Get(made->job_id());
  ASSERT_EQ(kept->files.size(), 2u);
  EXPECT_EQ(kept->files[1].name, "plan.json");
  EXPECT_EQ(kept->files[1].digest, Sha256Hex("{}"));
}

}  // namespace
}  // namespace sightline
