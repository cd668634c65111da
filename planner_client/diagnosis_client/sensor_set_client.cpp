// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/sensor_set_client.h"

#include <utility>

#include "planner_client/rpc_client/answer_job.h"
#include "sightline/v1/sensor_service.grpc.pb.h"

namespace sightline {

absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensorSet(const WorkerClientOptions& options,
                                                      v1::CreateSensorDiagnosisRequest request,
                                                      const std::vector<AssetFile>& images) {
  WorkerCall call(options, images);
  const auto service = v1::SensorService::NewStub(call.channel());
  AddAssetDigests(call, images, 0, images.size(), request.mutable_images());
  request.set_request_id(NewRequestId());
  v1::CreateSensorDiagnosisResponse created;
  v1::GetSensorDiagnosisResponse answer;
  absl::Status status = RunAnswerJob(
      &call, created,
      [&](grpc::ClientContext* context) {
        return service->CreateSensorDiagnosis(context, request, &created);
      },
      [&](grpc::ClientContext* context) {
        v1::GetSensorDiagnosisRequest get;
        get.set_job_id(created.job().job_id());
        return service->GetSensorDiagnosis(context, get, &answer);
      });
  if (!status.ok()) return status;
  return std::move(*answer.mutable_diagnosis());
}

}  // namespace sightline
