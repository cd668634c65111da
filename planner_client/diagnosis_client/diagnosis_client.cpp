#include "planner_client/diagnosis_client/diagnosis_client.h"

#include <functional>
#include <memory>
#include <utility>

#include "absl/strings/str_cat.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/diagnosis_service.grpc.pb.h"

namespace sightline {
namespace {

constexpr absl::Duration kGetTimeout = absl::Seconds(60);

void AddImages(const WorkerCall& call, const std::vector<AssetFile>& images,
               v1::RecordedSetSource* source) {
  for (size_t i = 0; i < images.size(); ++i) {
    v1::RenderAsset* asset = source->add_images();
    asset->set_file(images[i].file);
    asset->set_asset_digest(call.digests()[i]);
  }
}

// Creates a job, waits for its end and fetches its answer. `create` sets `job`.
absl::Status RunJob(WorkerCall* call, const v1::Job* job,
                    const std::function<grpc::Status(grpc::ClientContext*)>& create,
                    const std::function<grpc::Status(grpc::ClientContext*)>& get) {
  absl::Status status = call->Create(create);
  if (status.ok()) status = call->WaitForJob(job->job_id());
  if (status.ok()) {
    grpc::ClientContext context;
    SetTimeout(&context, kGetTimeout);
    // The job's error if it failed.
    status = FromGrpcStatus(get(&context));
  }
  if (absl::IsUnimplemented(status)) {
    return absl::UnimplementedError(
        absl::StrCat("the render worker cannot do this (is it older?): ", status.message()));
  }
  return status.ok() ? status : call->Explained(status, "interrupted; nothing was written");
}

}  // namespace

absl::StatusOr<v1::Diagnosis> DiagnoseRecordings(const WorkerClientOptions& options,
                                                 v1::CreateDiagnosisRequest request,
                                                 const std::vector<AssetFile>& images) {
  WorkerCall call(options, images);
  const auto service = v1::DiagnosisService::NewStub(call.channel());
  AddImages(call, images, request.mutable_source());
  request.set_request_id(NewRequestId());
  v1::CreateDiagnosisResponse created;
  v1::GetDiagnosisResponse answer;
  absl::Status status = RunJob(
      &call, created.mutable_job(),
      [&](grpc::ClientContext* context) {
        return service->CreateDiagnosis(context, request, &created);
      },
      [&](grpc::ClientContext* context) {
        v1::GetDiagnosisRequest get;
        get.set_job_id(created.job().job_id());
        return service->GetDiagnosis(context, get, &answer);
      });
  if (!status.ok()) return status;
  return std::move(*answer.mutable_diagnosis());
}

absl::StatusOr<v1::Verification> VerifyRecordings(const WorkerClientOptions& options,
                                                  v1::CreateVerificationRequest request,
                                                  const std::vector<AssetFile>& images) {
  WorkerCall call(options, images);
  const auto service = v1::DiagnosisService::NewStub(call.channel());
  AddImages(call, images, request.mutable_source());
  request.set_request_id(NewRequestId());
  v1::CreateVerificationResponse created;
  v1::GetVerificationResponse answer;
  absl::Status status = RunJob(
      &call, created.mutable_job(),
      [&](grpc::ClientContext* context) {
        return service->CreateVerification(context, request, &created);
      },
      [&](grpc::ClientContext* context) {
        v1::GetVerificationRequest get;
        get.set_job_id(created.job().job_id());
        return service->GetVerification(context, get, &answer);
      });
  if (!status.ok()) return status;
  return std::move(*answer.mutable_verification());
}

}  // namespace sightline
