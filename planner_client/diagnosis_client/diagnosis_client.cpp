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

// Names the files from `first` on, `count` of them, of what the call can upload.
void AddAssets(const WorkerCall& call, const std::vector<AssetFile>& files, size_t first,
               size_t count, google::protobuf::RepeatedPtrField<v1::RenderAsset>* assets) {
  for (size_t i = first; i < first + count; ++i) {
    v1::RenderAsset* asset = assets->Add();
    asset->set_file(files[i].file);
    asset->set_asset_digest(call.digests()[i]);
  }
}

// Creates a job, waits for its end and fetches its answer. `create` sets `created`.
template <typename Created>
absl::Status RunJob(WorkerCall* call, const Created& created,
                    const std::function<grpc::Status(grpc::ClientContext*)>& create,
                    const std::function<grpc::Status(grpc::ClientContext*)>& get) {
  absl::Status status = call->Create(create);
  if (status.ok()) status = call->WaitForJob(created.job().job_id());
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
                                                 const std::vector<AssetFile>& images,
                                                 const std::vector<AssetFile>& assets) {
  std::vector<AssetFile> files = images;
  files.insert(files.end(), assets.begin(), assets.end());
  WorkerCall call(options, files);
  const auto service = v1::DiagnosisService::NewStub(call.channel());
  AddAssets(call, files, 0, images.size(), request.mutable_source()->mutable_images());
  AddAssets(call, files, images.size(), assets.size(), request.mutable_assets());
  request.set_request_id(NewRequestId());
  v1::CreateDiagnosisResponse created;
  v1::GetDiagnosisResponse answer;
  absl::Status status = RunJob(
      &call, created,
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
  AddAssets(call, images, 0, images.size(), request.mutable_source()->mutable_images());
  request.set_request_id(NewRequestId());
  v1::CreateVerificationResponse created;
  v1::GetVerificationResponse answer;
  absl::Status status = RunJob(
      &call, created,
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
