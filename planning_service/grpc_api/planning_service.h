// SPDX-License-Identifier: Apache-2.0
// v1::PlanningService over PlanningJobs: identifies the client and converts messages.
#pragma once

#include <functional>

#include "planning_service/access/client_access.h"
#include "planning_service/jobs/planning_jobs.h"
#include "rpc_server/call_tracker.h"
#include "sightline/v1/planning_service.grpc.pb.h"

namespace sightline {

class PlanningServiceImpl final : public v1::PlanningService::Service {
 public:
  // The pointers' targets must outlive it.
  PlanningServiceImpl(PlanningJobs* jobs, ClientAccess* access, CallTracker* calls)
      : jobs_(jobs), access_(access), calls_(calls) {}

  grpc::Status UploadFile(grpc::ServerContext* context,
                          grpc::ServerReader<v1::UploadFileRequest>* reader,
                          v1::UploadFileResponse* response) override;
  grpc::Status CreatePlanningJob(grpc::ServerContext* context,
                                 const v1::CreatePlanningJobRequest* request,
                                 v1::CreatePlanningJobResponse* response) override;
  grpc::Status GetPlanningJob(grpc::ServerContext* context,
                              const v1::GetPlanningJobRequest* request,
                              v1::GetPlanningJobResponse* response) override;
  grpc::Status ListPlanningJobs(grpc::ServerContext* context,
                                const v1::ListPlanningJobsRequest* request,
                                v1::ListPlanningJobsResponse* response) override;
  grpc::Status CancelPlanningJob(grpc::ServerContext* context,
                                 const v1::CancelPlanningJobRequest* request,
                                 v1::CancelPlanningJobResponse* response) override;
  grpc::Status WatchPlanningJob(grpc::ServerContext* context,
                                const v1::WatchPlanningJobRequest* request,
                                grpc::ServerWriter<v1::WatchPlanningJobResponse>* writer) override;
  grpc::Status StreamResult(grpc::ServerContext* context, const v1::StreamResultRequest* request,
                            grpc::ServerWriter<v1::StreamResultResponse>* writer) override;
  grpc::Status PrepareRecipe(grpc::ServerContext* context, const v1::PrepareRecipeRequest* request,
                             v1::PrepareRecipeResponse* response) override;
  grpc::Status UnprepareRecipe(grpc::ServerContext* context,
                               const v1::UnprepareRecipeRequest* request,
                               v1::UnprepareRecipeResponse* response) override;
  grpc::Status StartJob(grpc::ServerContext* context, const v1::StartJobRequest* request,
                        v1::StartJobResponse* response) override;
  grpc::Status GetResultById(grpc::ServerContext* context, const v1::GetResultByIdRequest* request,
                             v1::GetResultByIdResponse* response) override;
  grpc::Status GetVisionState(grpc::ServerContext* context,
                              const v1::GetVisionStateRequest* request,
                              v1::GetVisionStateResponse* response) override;

 private:
  // Runs a call as the client that the peer's credentials identify.
  grpc::Status RunAs(const char* method, grpc::ServerContext* context,
                     const std::function<absl::Status(const Client&)>& call,
                     CallKind kind = CallKind::kUnary);
  absl::Status Upload(const Client& client, grpc::ServerContext* context,
                      grpc::ServerReader<v1::UploadFileRequest>* reader,
                      v1::UploadFileResponse* response);
  absl::Status Watch(const Client& client, grpc::ServerContext* context, const std::string& job_id,
                     grpc::ServerWriter<v1::WatchPlanningJobResponse>* writer);
  absl::Status Stream(const Client& client, grpc::ServerContext* context,
                      const v1::StreamResultRequest& request,
                      grpc::ServerWriter<v1::StreamResultResponse>* writer);

  PlanningJobs* const jobs_;
  ClientAccess* const access_;
  CallTracker* const calls_;
};

}  // namespace sightline
