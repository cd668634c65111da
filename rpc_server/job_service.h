// SPDX-License-Identifier: Apache-2.0
// JobService over a JobStore, and common parts of the services that make jobs in it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "core/job/job_store.h"
#include "rpc_server/call_tracker.h"
#include "sightline/v1/job_service.grpc.pb.h"

namespace sightline {

v1::Job JobToProto(const JobRecord& record);

// Exactly one of the two members is set.
struct JobAdmission {
  std::optional<v1::Job> known;  // the job that the same request made before
  std::unique_ptr<JobRoom> room;
};
// To be called before the content of a request is read; `fingerprint` and `bytes` as for JobStore.
// ALREADY_EXISTS: the `request_id` was used for another request. RESOURCE_EXHAUSTED (QUEUE_FULL):
// the limits on jobs are reached.
absl::StatusOr<JobAdmission> AdmitJob(JobStore* jobs, const std::string& kind,
                                      const std::string& request_id,
                                      const std::function<std::string()>& fingerprint,
                                      const std::string& peer,
                                      const std::function<int64_t()>& bytes);

class JobServiceImpl final : public v1::JobService::Service {
 public:
  JobServiceImpl(JobStore* jobs, CallTracker* calls) : jobs_(jobs), calls_(calls) {}

  grpc::Status GetJob(grpc::ServerContext* context, const v1::GetJobRequest* request,
                      v1::GetJobResponse* response) override;
  grpc::Status ListJobs(grpc::ServerContext* context, const v1::ListJobsRequest* request,
                        v1::ListJobsResponse* response) override;
  grpc::Status CancelJob(grpc::ServerContext* context, const v1::CancelJobRequest* request,
                         v1::CancelJobResponse* response) override;
  // Ends with UNAVAILABLE when the server drains.
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                        grpc::ServerWriter<v1::WatchJobResponse>* writer) override;

 private:
  JobStore* const jobs_;
  CallTracker* const calls_;
};

}  // namespace sightline
