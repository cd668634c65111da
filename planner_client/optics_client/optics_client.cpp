// SPDX-License-Identifier: Apache-2.0
#include "planner_client/optics_client/optics_client.h"

#include <utility>

#include "planner_client/rpc_client/answer_job.h"
#include "sightline/v1/optics_service.grpc.pb.h"

namespace sightline {

absl::StatusOr<v1::OpticsPlan> PlanOptics(const WorkerClientOptions& options,
                                          v1::CreateOpticsRequest request,
                                          const std::vector<AssetFile>& assets) {
  WorkerCall call(options, assets);
  const auto service = v1::OpticsService::NewStub(call.channel());
  AddAssetDigests(call, assets, 0, assets.size(), request.mutable_assets());
  request.set_request_id(NewRequestId());
  v1::CreateOpticsResponse created;
  v1::GetOpticsResponse answer;
  const absl::Status status = RunAnswerJob(
      &call, created,
      [&](grpc::ClientContext* context) {
        return service->CreateOptics(context, request, &created);
      },
      [&](grpc::ClientContext* context) {
        v1::GetOpticsRequest get;
        get.set_job_id(created.job().job_id());
        return service->GetOptics(context, get, &answer);
      });
  if (!status.ok()) return status;
  return std::move(*answer.mutable_optics());
}

}  // namespace sightline
