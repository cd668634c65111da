// SPDX-License-Identifier: Apache-2.0
// JobService over a JobStore.
#pragma once

#include "core/job/job_store.h"
#include "rpc_server/call_tracker.h"
#include "sightline/v1/job_service.grpc.pb.h"

namespace sightline {

v1::Job JobToProto(const JobRecord& record);

class JobServiceImpl final : public v1::JobService::Service {
 public:
  JobServiceImpl(JobStore* jobs, CallTracker* calls) : jobs_(jobs), calls_(calls) {}

  grpc::Status GetJob(grpc::ServerContext* context, const v1::GetJobRequest* request,
                      v1::GetJobResponse* response) override;
  grpc::Status ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest* request,
                        v1::ListJobsResponse* response) override;
  grpc::Status CancelJob(grpc::ServerContext* context, const v1::CancelJobRequest* request,
                         v1::CancelJobResponse* response) override;
  // While draining ends with UNAVAILABLE.
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                        grpc::ServerWriter<v1::WatchJobResponse>* writer) override;

 private:
  JobStore* const jobs_;
  CallTracker* const calls_;
};

}  // namespace sightline
