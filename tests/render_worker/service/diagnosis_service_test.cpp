// SPDX-License-Identifier: Apache-2.0
// DiagnosisService and its client over a real socket; what it runs is injected.
#include "render_worker/service/diagnosis_service.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <functional>
#include <sstream>
#include <thread>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planner_client/diagnosis_client/diagnosis_client.h"
#include "proto/status/rpc_status.h"
#include "render_worker/image_file/image_file.h"
#include "sightline/v1/diagnosis_service.grpc.pb.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "tests/limits/wait_until.h"
#include "tests/render_worker/service/plate_spec.h"
#include "tests/render_worker/service/recorded_set_fixture.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kRecordings = 4;

// Answers at once, with what it was asked.
absl::StatusOr<v1::Diagnosis> EchoPlate(const RecordedSet& set, const DiagnosisSettings& settings,
                                        const DiagnosisProgress&) {
  v1::Diagnosis answer;
  answer.set_set(set.description.name);
  answer.set_verdict("none");
  answer.set_seed(static_cast<int64_t>(settings.seed));
  answer.set_finding(absl::StrCat(settings.max_effects));
  for (const std::string& effect : settings.excluded_effects) {
    answer.add_ranked()->set_effect(effect);
  }
  // Mean numbers of the images.
  for (const RecordedFrame& frame : set.frames) {
    double sum = 0;
    for (const uint16_t value : frame.raw_dn.values) sum += value;
    answer.add_power()->set_strength(sum / static_cast<double>(frame.raw_dn.values.size()));
  }
  return answer;
}

absl::StatusOr<v1::Verification> EchoVerification(const RecordedSet& set,
                                                  const VerificationSettings& settings,
                                                  const DiagnosisProgress&) {
  v1::Verification answer;
  answer.set_set(set.description.name);
  answer.set_seed(static_cast<int64_t>(settings.seed));
  return answer;
}

class DiagnosisServiceTest : public RecordedSetTest {
 protected:
  // One rendered set for all tests.
  static void SetUpTestSuite() { rendered_ = new RenderedFolder(PlateSpec(kRecordings), {}); }
  static void TearDownTestSuite() { delete rendered_; }

  void SetUp() override {
    Open(rendered_->set());
    Start({EchoPlate, EchoVerification});
  }

  void Start(RecordingFunctions functions, int64_t max_set_bytes = int64_t{1} << 20) {
    StartServer(std::move(functions), max_set_bytes);
    channel_ = OpenChannel(client_);
    service_ = v1::DiagnosisService::NewStub(channel_);
    jobs_ = v1::JobService::NewStub(channel_);
  }

  v1::CreateDiagnosisRequest Request() const {
    v1::CreateDiagnosisRequest request;
    *request.mutable_source()->mutable_recordings() = set_.recordings;
    return request;
  }
  // With the images, which are uploaded.
  absl::StatusOr<v1::Job> Create(v1::CreateDiagnosisRequest request) {
    WorkerCall call(client_, set_.images);
    for (size_t i = 0; i < set_.images.size(); ++i) {
      v1::RenderAsset* image = request.mutable_source()->add_images();
      image->set_file(set_.images[i].file);
      image->set_asset_digest(call.digests()[i]);
    }
    return CreateAsIs(request, &call);
  }
  absl::StatusOr<v1::Job> CreateAsIs(const v1::CreateDiagnosisRequest& request, WorkerCall* call) {
    v1::CreateDiagnosisResponse response;
    SIGHTLINE_RETURN_IF_ERROR(call->Create([&](grpc::ClientContext* context) {
      return service_->CreateDiagnosis(context, request, &response);
    }));
    return response.job();
  }
  absl::StatusOr<v1::Diagnosis> Get(const std::string& job_id) {
    grpc::ClientContext context;
    context.set_deadline(FarDeadline());
    v1::GetDiagnosisRequest request;
    request.set_job_id(job_id);
    v1::GetDiagnosisResponse response;
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(service_->GetDiagnosis(&context, request, &response)));
    return response.diagnosis();
  }
  void Wait(const std::string& job_id) {
    WorkerCall call(client_, no_images_);
    ASSERT_TRUE(call.WaitForJob(job_id).ok());
  }

  static RenderedFolder* rendered_;
  std::vector<AssetFile> no_images_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::DiagnosisService::Stub> service_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

RenderedFolder* DiagnosisServiceTest::rendered_ = nullptr;

TEST_F(DiagnosisServiceTest, SetAndSettingsReachTheDiagnosis) {
  v1::CreateDiagnosisRequest request = Request();
  auto answer = DiagnoseRecordings(client_, request, set_.images);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->set(), "test");
  EXPECT_EQ(answer->seed(), 1);
  EXPECT_EQ(answer->finding(), "2");
  ASSERT_EQ(answer->power_size(), kRecordings);
  for (int i = 0; i < kRecordings; ++i) {
    const auto image = ReadRawImage(set_.folder + "/" + set_.images[i].file);
    ASSERT_TRUE(image.ok());
    double sum = 0;
    for (const uint16_t value : image->values) sum += value;
    EXPECT_EQ(answer->power(i).strength(), sum / static_cast<double>(image->values.size()));
  }
  // Remarks on the images go with the answer: so few recordings have some.
  EXPECT_GT(answer->warnings_size(), 0);

  request.set_seed(7);
  request.set_max_effects(3);
  request.add_excluded_effects("sensor.smear");
  answer = DiagnoseRecordings(client_, request, set_.images);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->seed(), 7);
  EXPECT_EQ(answer->finding(), "3");
  EXPECT_EQ(answer->ranked(0).effect(), "sensor.smear");
}

TEST_F(DiagnosisServiceTest, Verification) {
  v1::CreateVerificationRequest request;
  *request.mutable_source()->mutable_recordings() = set_.recordings;
  request.set_seed(5);
  const auto answer = VerifyRecordings(client_, request, set_.images);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->set(), "test");
  EXPECT_EQ(answer->seed(), 5);
  EXPECT_GT(answer->warnings_size(), 0);
}

TEST_F(DiagnosisServiceTest, ProgressIsReported) {
  std::atomic<double> received = 0;
  Start({[&](const RecordedSet& set, const DiagnosisSettings& settings,
             const DiagnosisProgress& progress) {
           for (int i = 0; i <= 10; ++i) {
             // Too frequent reports are dropped: it reports until the client has got one.
             WaitUntil([&] {
               EXPECT_TRUE(progress(0.1 * i, i < 5 ? "fitting" : "naming"));
               return received > 0.1 * i - 0.01;
             });
           }
           return EchoPlate(set, settings, progress);
         },
         EchoVerification});
  std::vector<std::pair<double, std::string>> reports;
  client_.on_progress = [&](double fraction, const std::string& message) {
    reports.emplace_back(fraction, message);
    received = fraction;
  };
  ASSERT_TRUE(DiagnoseRecordings(client_, Request(), set_.images).ok());
  int fitting = 0, naming = 0;
  for (size_t i = 0; i < reports.size(); ++i) {
    EXPECT_GE(reports[i].first, reports[i > 0 ? i - 1 : 0].first);
    fitting += reports[i].second == "fitting";
    naming += reports[i].second == "naming";
  }
  EXPECT_GE(fitting, 3);
  EXPECT_GE(naming, 3);
  EXPECT_EQ(reports.back().first, 1);
}

TEST_F(DiagnosisServiceTest, SameRequestIdSameJobThatRunsOnce) {
  std::atomic<int> runs = 0;
  Start({[&](const RecordedSet& set, const DiagnosisSettings& settings,
             const DiagnosisProgress& progress) {
           ++runs;
           return EchoPlate(set, settings, progress);
         },
         EchoVerification});
  v1::CreateDiagnosisRequest request = Request();
  request.set_request_id("a");
  const auto first = Create(request);
  const auto second = Create(request);
  ASSERT_TRUE(first.ok() && second.ok()) << first.status() << second.status();
  EXPECT_EQ(first->kind(), "diagnose");
  EXPECT_EQ(first->job_id(), second->job_id());
  Wait(first->job_id());
  EXPECT_TRUE(Get(first->job_id()).ok());
  // Long after the job, and as often as wanted.
  EXPECT_TRUE(Get(first->job_id()).ok());
  EXPECT_EQ(runs, 1);
  request.set_seed(2);
  EXPECT_TRUE(absl::IsAlreadyExists(Create(request).status()));
  request.set_request_id("b");
  const auto third = Create(request);
  ASSERT_TRUE(third.ok());
  EXPECT_NE(third->job_id(), first->job_id());
}

// Runs until it is stopped.
absl::StatusOr<v1::Diagnosis> Endless(const RecordedSet&, const DiagnosisSettings&,
                                      const DiagnosisProgress& progress) {
  while (progress(0.5, "working")) absl::SleepFor(absl::Milliseconds(1));
  return absl::CancelledError("stopped");
}

TEST_F(DiagnosisServiceTest, CancelEndsTheJobSoon) {
  Start({Endless, EchoVerification});
  const auto job = Create(Request());
  ASSERT_TRUE(job.ok()) << job.status();
  const absl::Status running = Get(job->job_id()).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(running)) << running;
  EXPECT_EQ(ErrorReason(running), "JOB_NOT_FINISHED");
  WorkerCall call(client_, no_images_);
  call.Cancel(job->job_id());
  Wait(job->job_id());
  EXPECT_TRUE(absl::IsCancelled(Get(job->job_id()).status()));
}

TEST_F(DiagnosisServiceTest, InterruptedClientCancelsTheJob) {
  Start({Endless, EchoVerification});
  std::atomic<bool> interrupted = false;
  client_.interrupted = &interrupted;
  client_.on_progress = [&](double fraction, const std::string&) {
    if (fraction >= 0.5) interrupted = true;
  };
  const absl::Status status = DiagnoseRecordings(client_, Request(), set_.images).status();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
  WaitUntil([&] {
    v1::ListJobsResponse response;
    grpc::ClientContext context;
    context.set_deadline(FarDeadline());
    EXPECT_TRUE(jobs_->ListJobs(&context, {}, &response).ok());
    return response.jobs_size() == 1 && response.jobs(0).state() == v1::Job::STATE_CANCELLED;
  });
}

TEST_F(DiagnosisServiceTest, FailedJobGivesItsError) {
  Start({[](const RecordedSet&, const DiagnosisSettings&,
            const DiagnosisProgress&) -> absl::StatusOr<v1::Diagnosis> {
           return absl::FailedPreconditionError("no dark frames");
         },
         [](const RecordedSet&, const VerificationSettings&, const DiagnosisProgress&)
             -> absl::StatusOr<v1::Verification> { return absl::InternalError("broken"); }});
  const absl::Status status = DiagnoseRecordings(client_, Request(), set_.images).status();
  EXPECT_TRUE(absl::IsFailedPrecondition(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("no dark frames"));
  EXPECT_NE(ErrorReason(status), "JOB_NOT_FINISHED");
  v1::CreateVerificationRequest request;
  *request.mutable_source()->mutable_recordings() = set_.recordings;
  const absl::Status verify = VerifyRecordings(client_, request, set_.images).status();
  EXPECT_TRUE(absl::IsInternal(verify)) << verify;
}

TEST_F(DiagnosisServiceTest, UnknownThingsAreNotFound) {
  v1::CreateDiagnosisRequest request = Request();
  v1::RenderAsset* image = request.mutable_source()->add_images();
  image->set_file(set_.images[0].file);
  image->set_asset_digest("00");
  grpc::ClientContext context;
  v1::CreateDiagnosisResponse response;
  const absl::Status status =
      FromGrpcStatus(service_->CreateDiagnosis(&context, request, &response));
  EXPECT_TRUE(absl::IsNotFound(status)) << status;
  EXPECT_EQ(ErrorReason(status), "ASSET_UNKNOWN");
  EXPECT_EQ(ErrorMetadata(status)["asset_digest"], "00");
  EXPECT_EQ(ErrorReason(Get("diagnose-none").status()), "JOB_UNKNOWN");
  // A job of another kind has no diagnosis.
  v1::CreateVerificationRequest verification;
  *verification.mutable_source()->mutable_recordings() = set_.recordings;
  ASSERT_TRUE(VerifyRecordings(client_, verification, set_.images).ok());
  grpc::ClientContext list_context;
  v1::ListJobsResponse jobs;
  ASSERT_TRUE(jobs_->ListJobs(&list_context, {}, &jobs).ok());
  EXPECT_EQ(ErrorReason(Get(jobs.jobs(0).job_id()).status()), "JOB_UNKNOWN");
}

TEST_F(DiagnosisServiceTest, BadRequestsAreNamed) {
  const struct {
    std::function<void(v1::CreateDiagnosisRequest*)> change;
    std::string expected;
  } cases[] = {
      {[](auto* r) { r->set_max_effects(4); }, "max_effects"},
      {[](auto* r) { r->set_max_effects(0); }, "max_effects"},
      {[](auto* r) { r->add_excluded_effects("sensor.smaer"); }, "sensor.smear"},
      {[](auto* r) { r->mutable_source()->mutable_recordings()->clear_lens(); },
       "lens.focal_length_m"},
      {[](auto* r) {
         r->mutable_source()->mutable_recordings()->mutable_recordings(1)->set_file("../x.png");
       },
       "must stay in the set's folder"},
      {[](auto* r) {
         r->mutable_source()->mutable_recordings()->mutable_recordings(1)->set_file("x.png");
       },
       "has no entry for x.png, recordings[1]"},
      {[](auto* r) {
         r->mutable_source()->mutable_recordings()->mutable_recordings()->RemoveLast();
       },
       "has 4 entries for 3 recordings"},
      {[](auto* r) {
         r->mutable_source()->mutable_recordings()->mutable_recordings(2)->set_roi_rows_px(47);
       },
       "images/2.png"},
  };
  for (const auto& c : cases) {
    v1::CreateDiagnosisRequest request = Request();
    c.change(&request);
    const absl::Status status = Create(request).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << c.expected << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(c.expected));
  }
}

TEST_F(DiagnosisServiceTest, BadImagesAreNamedWithoutTheServersPaths) {
  std::string small = folder_ + "/small.png";
  ASSERT_TRUE(WriteRawImage(small, Image<uint16_t>(62, 48), "", ImageFormat::kPng).ok());
  std::ifstream file(small, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  const std::vector<AssetFile> good = set_.images;
  for (const std::string& bad :
       {bytes.str(), std::string("no image"), good[1].bytes.substr(0, 90)}) {
    set_.images = good;
    set_.images[1].bytes = bad;
    const absl::Status status = Create(Request()).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_EQ(FieldViolations(status).at(0).field, "source.images");
    EXPECT_THAT(FieldViolations(status).at(0).description, HasSubstr("images/1.png"));
    EXPECT_THAT(std::string(status.message()), ::testing::Not(HasSubstr(folder_)));
  }
}

TEST_F(DiagnosisServiceTest, PlatesHaveNoPartModel) {
  v1::CreateDiagnosisRequest request = Request();
  request.mutable_inspection()->set_name("table");
  absl::Status status = Create(request).status();
  EXPECT_EQ(FieldViolations(status).at(0).field, "inspection") << status;
  request = Request();
  request.add_assets()->set_file("table.obj");
  status = Create(request).status();
  EXPECT_EQ(FieldViolations(status).at(0).field, "assets") << status;
}

TEST_F(DiagnosisServiceTest, SetsThatNeedTooMuchMemoryAreRefused) {
  Start({Endless, EchoVerification}, /*max_set_bytes=*/int64_t{64} * 48 * 2 * kRecordings - 1);
  absl::Status status = Create(Request()).status();
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_EQ(ErrorReason(status), "SET_TOO_LARGE");
  // Two at a time are too many, one after the other are not.
  Start({Endless, EchoVerification}, int64_t{64} * 48 * 2 * kRecordings * 3 / 2);
  client_.retry_for = absl::ZeroDuration();
  const auto job = Create(Request());
  ASSERT_TRUE(job.ok()) << job.status();
  status = Create(Request()).status();
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_EQ(ErrorReason(status), "OVERLOADED");
  WorkerCall call(client_, no_images_);
  call.Cancel(job->job_id());
  Wait(job->job_id());
  EXPECT_TRUE(Create(Request()).ok());
}

TEST_F(DiagnosisServiceTest, MissingFunctionsAreSaid) {
  Start({});
  const absl::Status status = DiagnoseRecordings(client_, Request(), set_.images).status();
  EXPECT_TRUE(absl::IsUnimplemented(status)) << status;
}

}  // namespace
}  // namespace sightline
