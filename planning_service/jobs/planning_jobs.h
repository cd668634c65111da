// SPDX-License-Identifier: Apache-2.0
// Handles requests of clients to the planning service, for all front ends: checks task and client,
// then uses job store and artefact store.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/access/client_access.h"
#include "planning_service/artefact_store/artefact_store.h"
#include "planning_service/job_store/planning_job_store.h"
#include "planning_service/jobs/arriving_bytes.h"
#include "sightline/v1/planning_service.pb.h"
#include "sightline/v1/planning_task.pb.h"

namespace sightline {

v1::PlanningJob PlanningJobToProto(const PlanningJob& job);

// A file that is being uploaded, counted towards its client's quota. Bytes beyond the quota are not
// stored but still count for the digest: a file that the client has already takes no more space.
class FileUpload {
 public:
  // `stored_bytes`: bytes that the client stores, without running uploads.
  FileUpload(PlanningJobStore* store, Client client, std::unique_ptr<ArtefactWriter> writer,
             int64_t stored_bytes, ArrivingBytes* arriving);
  // RESOURCE_EXHAUSTED, reasons UPLOAD_TOO_LARGE, DISK_FULL.
  absl::Status Write(const std::string& bytes);
  // Completes the upload; returns digest and size, with an empty `name`. INVALID_ARGUMENT, reason
  // DIGEST_MISMATCH: `expected_digest` is given and differs. RESOURCE_EXHAUSTED, reason
  // QUOTA_EXCEEDED.
  absl::StatusOr<JobFile> Finish(const std::string& expected_digest);

 private:
  PlanningJobStore* store_;
  Client client_;
  std::unique_ptr<ArtefactWriter> writer_;
  int64_t stored_bytes_;
  ArrivingBytes::Upload arriving_;
  bool over_quota_ = false;
};

// A result file that can be read piece by piece.
struct OpenResult {
  JobFile file;
  std::string path;  // of the complete file
};

// Thread-safe.
class PlanningJobs {
 public:
  // All must outlive it.
  PlanningJobs(PlanningJobStore* store, ArtefactStore* artefacts);

  absl::StatusOr<FileUpload> Upload(const Client& client);
  // Errors: see v1::PlanningService.CreatePlanningJob. `files` need only name and digest.
  absl::StatusOr<PlanningJob> Create(const Client& client, const std::string& request_id,
                                     const v1::PlanningTask& task, std::vector<JobFile> files,
                                     int priority);
  absl::StatusOr<PlanningJob> Get(const Client& client, const std::string& job_id);
  struct Page {
    std::vector<PlanningJob> jobs;
    std::string next_page_token;  // empty: there are no more
  };
  absl::StatusOr<Page> List(const Client& client, const v1::ListPlanningJobsRequest& request);
  absl::StatusOr<PlanningJob> Cancel(const Client& client, const std::string& job_id);
  // As PlanningJobStore::WaitForChange.
  absl::StatusOr<PlanningJob> WaitForChange(const Client& client, const std::string& job_id,
                                            int64_t revision, absl::Duration timeout);
  // Events of one job after `sequence`, waiting up to `timeout` for the first.
  absl::StatusOr<std::vector<JobEvent>> WaitForEvents(const Client& client,
                                                      const std::string& job_id, int64_t sequence,
                                                      absl::Duration timeout);
  // As PlanningJobStore::NewestEvent.
  absl::StatusOr<int64_t> NewestEvent() { return store_->NewestEvent(); }
  // True if an event has this id, so that a receiver whose last id it is has missed only the events
  // after it. False if the id was never given, was lost by a restore, or was removed.
  absl::StatusOr<bool> KnowsEvent(int64_t sequence);
  // FAILED_PRECONDITION, reason JOB_NOT_FINISHED; NOT_FOUND, reasons JOB_UNKNOWN, RESULT_UNKNOWN;
  // DATA_LOSS: the bytes on disk are not those that were stored.
  absl::StatusOr<OpenResult> Result(const Client& client, const std::string& job_id,
                                    const std::string& name);

  // Recipes: see v1::PlanningService. Returns the digest.
  absl::StatusOr<std::string> PrepareRecipe(const Client& client, const std::string& recipe_id,
                                            const v1::PlanningTask& task,
                                            std::vector<JobFile> files);
  absl::Status UnprepareRecipe(const Client& client, const std::string& recipe_id);
  absl::StatusOr<PlanningJob> StartJob(const Client& client, const std::string& request_id,
                                       const std::string& recipe_id, int priority);
  absl::StatusOr<v1::GetVisionStateResponse> VisionState(const Client& client);

 private:
  // Checks the task and the client's right to its files; fills in sizes.
  absl::Status Check(const Client& client, const v1::PlanningTask& task,
                     std::vector<JobFile>* files);
  // Keeps the job with the request that made it.
  absl::StatusOr<PlanningJob> Accept(const Client& client, NewPlanningJob job);

  PlanningJobStore* store_;
  ArtefactStore* artefacts_;
  ArrivingBytes arriving_;
};

}  // namespace sightline
