// SPDX-License-Identifier: Apache-2.0
// Jobs whose result is one message, which is kept until newer results need its memory.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/job/job_store.h"
#include "core/memo/lru_store.h"
#include "render_worker/service/asset_store.h"
#include "rpc_server/job_service.h"
#include "sightline/v1/job_service.pb.h"

namespace sightline {

// Least time between two reports of a job's progress.
inline constexpr std::chrono::milliseconds kProgressInterval{50};

class AnswerJobs {
 public:
  // `jobs` must outlive this object. `spool_folder`: removed from error messages.
  // `max_result_bytes`: for all answers; the least recently used are dropped first.
  AnswerJobs(JobStore* jobs, std::string spool_folder, int64_t max_result_bytes)
      : jobs_(jobs), spool_folder_(std::move(spool_folder)), results_(max_result_bytes) {}

  // As AdmitJob.
  template <typename Request>
  absl::StatusOr<JobAdmission> Admit(const std::string& kind, const std::string& peer,
                                     const Request& request) {
    return AdmitJob(
        jobs_, kind, request.request_id(), [&] { return DigestOf(request); }, peer,
        [&] { return MemoryOf(request); });
  }

  // Reports progress in [0, 1] with a text; false means that the job is cancelled.
  using Progress = std::function<bool(double fraction, const std::string& what)>;
  // Gets the progress function and the context, which signals cancellation; returns the serialised
  // answer.
  using Work = std::function<absl::StatusOr<std::string>(const Progress&, JobContext&)>;

  // Queues the work in its admitted slot. Identical requests without `request_id` are
  // different jobs. The job's error is RESOURCE_EXHAUSTED if the answer is too large for a
  // message.
  template <typename Request>
  absl::StatusOr<v1::Job> Create(const std::string& kind, const Request& request,
                                 std::unique_ptr<JobRoom> room, Work&& work) {
    return Queue(kind, request.request_id(), DigestOf(request), std::move(room), std::move(work));
  }

  // The serialised answer of a finished job of this kind. NOT_FOUND, reason JOB_UNKNOWN or
  // RESULT_DROPPED; FAILED_PRECONDITION, reason JOB_NOT_FINISHED; the job's error, unless it was
  // cancelled and its work returned a partial result.
  absl::StatusOr<std::shared_ptr<const std::string>> Result(const std::string& job_id,
                                                            const std::string& kind);

 private:
  // Digest of all fields except the id.
  template <typename Request>
  static std::string DigestOf(Request request) {
    request.clear_request_id();
    return MessageDigest(request);
  }
  absl::StatusOr<v1::Job> Queue(const std::string& kind, const std::string& request_id,
                                const std::string& request_digest, std::unique_ptr<JobRoom> room,
                                Work work);

  JobStore* const jobs_;
  const std::string spool_folder_;
  LruStore<std::string> results_;  // by digest
};

}  // namespace sightline
