// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/job_service.h"

#include <utility>

#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

v1::Job::State StateToProto(JobState state) {
  switch (state) {
    case JobState::kQueued:
      return v1::Job::STATE_QUEUED;
    case JobState::kRunning:
      return v1::Job::STATE_RUNNING;
    case JobState::kSucceeded:
      return v1::Job::STATE_SUCCEEDED;
    case JobState::kFailed:
      return v1::Job::STATE_FAILED;
    case JobState::kCancelled:
      return v1::Job::STATE_CANCELLED;
  }
  return v1::Job::STATE_UNSPECIFIED;
}

absl::StatusOr<JobRecord> Known(absl::StatusOr<JobRecord> job) {
  if (absl::IsNotFound(job.status())) return WithErrorInfo(job.status(), "JOB_UNKNOWN");
  return job;
}

}  // namespace

absl::StatusOr<JobAdmission> AdmitJob(JobStore* jobs, const std::string& kind,
                                      const std::string& request_id,
                                      const std::function<std::string()>& fingerprint,
                                      const std::string& peer,
                                      const std::function<int64_t()>& bytes) {
  JobAdmission admission;
  SIGHTLINE_ASSIGN_OR_RETURN(const std::optional<JobRecord> known,
                             jobs->Find(kind, request_id, fingerprint));
  if (known.has_value()) {
    admission.known = JobToProto(*known);
    return admission;
  }
  absl::StatusOr<std::unique_ptr<JobRoom>> room = jobs->Reserve(peer, bytes);
  if (!room.ok()) return WithErrorInfo(room.status(), "QUEUE_FULL");
  admission.room = *std::move(room);
  return admission;
}

v1::Job JobToProto(const JobRecord& record) {
  v1::Job job;
  job.set_job_id(record.job_id);
  job.set_kind(record.kind);
  job.set_state(StateToProto(record.state));
  job.set_progress(record.progress);
  job.set_message(record.message);
  job.set_result_key(record.result_key);
  if (!record.error.ok()) {
    // ToGrpcStatus limits the length of the message and makes it valid UTF-8.
    const grpc::Status error = ToGrpcStatus(record.error);
    job.set_error_code(error.error_code());
    job.set_error_message(error.error_message());
  }
  return job;
}

grpc::Status JobServiceImpl::GetJob(grpc::ServerContext* context, const v1::GetJobRequest* request,
                                    v1::GetJobResponse* response) {
  return calls_->Run("GetJob", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(JobRecord job, Known(jobs_->Get(request->job_id())));
    *response->mutable_job() = JobToProto(job);
    return absl::OkStatus();
  });
}

grpc::Status JobServiceImpl::ListJobs(grpc::ServerContext* context,
                                      const v1::ListJobsRequest* request,
                                      v1::ListJobsResponse* response) {
  return calls_->Run("ListJobs", context, [&]() -> absl::Status {
    for (const JobRecord& job : jobs_->List(request->kind())) {
      *response->add_jobs() = JobToProto(job);
    }
    return absl::OkStatus();
  });
}

grpc::Status JobServiceImpl::CancelJob(grpc::ServerContext* context,
                                       const v1::CancelJobRequest* request,
                                       v1::CancelJobResponse* response) {
  return calls_->Run("CancelJob", context, [&]() -> absl::Status {
    SIGHTLINE_ASSIGN_OR_RETURN(JobRecord job, Known(jobs_->Cancel(request->job_id())));
    *response->mutable_job() = JobToProto(job);
    return absl::OkStatus();
  });
}

grpc::Status JobServiceImpl::WatchJob(grpc::ServerContext* context,
                                      const v1::WatchJobRequest* request,
                                      grpc::ServerWriter<v1::WatchJobResponse>* writer) {
  const auto watch = [&]() -> absl::Status {
    absl::StatusOr<JobRecord> job = Known(jobs_->Get(request->job_id()));
    int64_t sent_revision = -1;
    while (true) {
      if (!job.ok()) return job.status();
      // A drain cancels jobs. The client gets UNAVAILABLE instead: another server can do the job.
      if (calls_->draining() && job->state != JobState::kSucceeded) {
        return WithErrorInfo(absl::UnavailableError("the server is shutting down"), "DRAINING");
      }
      if (job->revision != sent_revision) {
        v1::WatchJobResponse response;
        *response.mutable_job() = JobToProto(*job);
        SIGHTLINE_RETURN_IF_ERROR(calls_->Write(context, [&] { return writer->Write(response); }));
        sent_revision = job->revision;
      }
      if (job->finished()) return absl::OkStatus();
      SIGHTLINE_RETURN_IF_ERROR(calls_->CheckStop(context));
      job = Known(jobs_->WaitForChange(request->job_id(), sent_revision, absl::Milliseconds(50)));
    }
  };
  return calls_->Run("WatchJob", context, watch, CallKind::kStream);
}

}  // namespace sightline
