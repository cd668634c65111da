// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/diagnosis_client.h"

#include <functional>
#include <memory>
#include <utility>

#include "planner_client/rpc_client/answer_job.h"
#include "sightline/v1/diagnosis_service.grpc.pb.h"

namespace sightline {
absl::StatusOr<v1::Diagnosis> DiagnoseRecordings(const WorkerClientOptions& options,
                                                 v1::CreateDiagnosisRequest request,
                                                 const std::vector<AssetFile>& images,
                                                 const std::vector<AssetFile>& assets,
                                                 const std::function<void()>& on_waiting_for_rest) {
  std::vector<AssetFile> files = images;
  files.insert(files.end(), assets.begin(), assets.end());
  WorkerCall call(options, files);
  const auto service = v1::DiagnosisService::NewStub(call.channel());
  AddAssetDigests(call, files, 0, images.size(), request.mutable_source()->mutable_images());
  AddAssetDigests(call, files, images.size(), assets.size(), request.mutable_assets());
  request.set_request_id(NewRequestId());
  v1::CreateDiagnosisResponse created;
  v1::GetDiagnosisResponse answer;
  absl::Status status = RunAnswerJob(
      &call, created,
      [&](grpc::ClientContext* context) {
        return service->CreateDiagnosis(context, request, &created);
      },
      [&](grpc::ClientContext* context) {
        v1::GetDiagnosisRequest get;
        get.set_job_id(created.job().job_id());
        return service->GetDiagnosis(context, get, &answer);
      },
      on_waiting_for_rest);
  if (!status.ok()) return status;
  return std::move(*answer.mutable_diagnosis());
}

absl::StatusOr<v1::Verification> VerifyRecordings(const WorkerClientOptions& options,
                                                  v1::CreateVerificationRequest request,
                                                  const std::vector<AssetFile>& images) {
  WorkerCall call(options, images);
  const auto service = v1::DiagnosisService::NewStub(call.channel());
  AddAssetDigests(call, images, 0, images.size(), request.mutable_source()->mutable_images());
  request.set_request_id(NewRequestId());
  v1::CreateVerificationResponse created;
  v1::GetVerificationResponse answer;
  absl::Status status = RunAnswerJob(
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
