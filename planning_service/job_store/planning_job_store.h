// SPDX-License-Identifier: Apache-2.0
// Jobs, recipes, uploads and events of the planning service, kept through the end of any process.
//
// Every method is one transaction: a returned result is on disk, and a call without an answer
// happened as a whole or not at all. Errors of all of them: UNAVAILABLE (the database does not
// answer; the call may have happened), RESOURCE_EXHAUSTED with reason DISK_FULL, DATA_LOSS (the
// database is damaged).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/job_store/planning_job.h"

namespace sightline {

// Limits of one client.
struct ClientQuota {
  int max_queued_jobs = 1000;
  int max_running_jobs = 1000;
  int64_t max_stored_bytes = int64_t{100} << 30;  // uploads, and files and results of its jobs
};

struct NewPlanningJob {
  std::string client;
  std::string kind;
  std::string request_id;  // empty: always a new job
  std::string fingerprint;
  std::string task;
  std::vector<JobFile> files;
  std::string traceparent;  // empty or valid
  int priority = 0;
};

struct PlanningJobFilter {
  std::optional<std::string> client;  // unset: of all
  std::vector<JobState> states;       // empty: all
  std::vector<std::string> kinds;     // empty: all
  int64_t before_sequence = 0;        // only older ones; 0: from the newest
  int limit = 100;
};

// Event of a job. Delivered at least once, in order of `sequence`.
struct JobEvent {
  int64_t sequence = 0;
  std::string type;  // "accepted", "progress", "done", "failed", "cancelled"
  // As it was then: id, client, kind, request_id, priority, state, progress, message, attempts,
  // failure, results, revision.
  PlanningJob job;
  absl::Time time;
};

struct Recipe {
  std::string client;
  std::string recipe_id;
  std::string kind;
  std::string fingerprint;
  std::string task;
  std::vector<JobFile> files;
};

// Number of an attempt of a job. Reports of an attempt count only while it is the job's current
// one; else ABORTED.
struct Attempt {
  std::string job_id;
  int number = 0;
};

class PlanningJobStore {
 public:
  virtual ~PlanningJobStore() = default;

  // Called by a service before anything else. A database that was restored from a backup continues
  // with event ids that were never given; returns whether it did (database_identity.h).
  virtual absl::StatusOr<bool> BeginService() = 0;

  // The same client's same non-empty request_id gives the same job; ALREADY_EXISTS, reason
  // REQUEST_ID_REUSED, if its fingerprint differs. RESOURCE_EXHAUSTED, reason QUOTA_EXCEEDED (an
  // idempotent repetition never is).
  virtual absl::StatusOr<PlanningJob> Create(const NewPlanningJob& job,
                                             const ClientQuota& quota) = 0;
  // NOT_FOUND, reason JOB_UNKNOWN.
  virtual absl::StatusOr<PlanningJob> Get(const std::string& job_id) = 0;
  // Newest first. `task` and `files` of the jobs are left empty. Here, in Get and in Create queued
  // jobs have `jobs_ahead`: with one worker exactly the jobs that Claim gives before, unless others
  // come or a client is at its quota; with several the clients with fewer running jobs go first.
  virtual absl::StatusOr<std::vector<PlanningJob>> List(const PlanningJobFilter& filter) = 0;
  // A queued job is cancelled at once, a running one is asked to stop; finished ones stay.
  virtual absl::StatusOr<PlanningJob> RequestCancel(const std::string& job_id) = 0;
  // Waits until the job's revision exceeds `revision` or the timeout passes; returns the job.
  virtual absl::StatusOr<PlanningJob> WaitForChange(const std::string& job_id, int64_t revision,
                                                    absl::Duration timeout) = 0;
  // Counts by state, of a client or of all.
  struct Counts {
    int queued = 0;
    int running = 0;
    int64_t stored_bytes = 0;
  };
  virtual absl::StatusOr<Counts> Count(const std::optional<std::string>& client) = 0;

  // Next job to run: highest priority; of these the client's with the fewest running jobs; of these
  // the oldest. None of a client that runs its max_running_jobs. The job is RUNNING then and
  // belongs to this store's owner.
  virtual absl::StatusOr<std::optional<PlanningJob>> Claim(
      const std::function<ClientQuota(const std::string& client)>& quota_of) = 0;
  // Returns whether the job was asked to stop. Progress never goes back. Events of type progress
  // are made at most once a second of steady clock and job.
  virtual absl::StatusOr<bool> ReportProgress(const Attempt& attempt, double progress,
                                              const std::string& message) = 0;
  virtual absl::Status Succeed(const Attempt& attempt, const std::vector<JobFile>& results) = 0;
  virtual absl::Status Fail(const Attempt& attempt, const JobFailure& failure) = 0;
  virtual absl::Status MarkCancelled(const Attempt& attempt) = 0;
  // Back into the queue, at its old place. `crashed`: the attempt ended without a word; counted,
  // and the count starts anew when `advanced`: it had got further than the attempts before.
  virtual absl::Status Requeue(const Attempt& attempt, bool crashed, bool advanced) = 0;
  // Puts running jobs whose owner is gone back into the queue; returns how many. An embedded store
  // has one owner at a time. A shared one knows living owners by their sessions with the database,
  // not by clocks.
  virtual absl::StatusOr<int> RequeueOrphans() = 0;

  // NOT_FOUND, reason RECIPE_UNKNOWN.
  virtual absl::StatusOr<Recipe> GetRecipe(const std::string& client,
                                           const std::string& recipe_id) = 0;
  virtual absl::Status PutRecipe(const Recipe& recipe, const ClientQuota& quota) = 0;
  virtual absl::Status DeleteRecipe(const std::string& client, const std::string& recipe_id) = 0;
  virtual absl::StatusOr<int> CountRecipes(const std::string& client) = 0;

  // Remembers that the client uploaded the file; RESOURCE_EXHAUSTED, reason QUOTA_EXCEEDED.
  virtual absl::Status AddUpload(const std::string& client, const JobFile& file,
                                 const ClientQuota& quota) = 0;
  // Whether the client may use the file: uploaded it, or has it in a job or recipe. Its size.
  virtual absl::StatusOr<std::optional<int64_t>> FindFile(const std::string& client,
                                                          const std::string& digest) = 0;

  // Events after `sequence` in order, of one job or of all.
  virtual absl::StatusOr<std::vector<JobEvent>> Events(int64_t after_sequence,
                                                       const std::optional<std::string>& job_id,
                                                       int limit) = 0;
  // Waits until there is an event after `sequence` or the timeout passes.
  virtual void WaitForEvent(int64_t after_sequence, absl::Duration timeout) = 0;
  // Largest id given so far; 0: none.
  virtual absl::StatusOr<int64_t> NewestEvent() = 0;
  // Whether an event has this id: not if it was removed, or lost by a restore.
  virtual absl::StatusOr<bool> HasEvent(int64_t sequence) = 0;
  // How far a receiver of events got; 0 at first.
  virtual absl::StatusOr<int64_t> EventCursor(const std::string& receiver) = 0;
  virtual absl::Status SetEventCursor(const std::string& receiver, int64_t sequence) = 0;
  // True for one process at a time and receiver, while its session lives: that one delivers.
  virtual bool HoldsReceiver(const std::string& receiver) = 0;

  // Time that the service has been running, kept across restarts: advanced by a steady clock, so
  // that a jump of the wall clock makes nothing old. Retention counts in it.
  virtual absl::Status AdvanceServiceTime(absl::Duration by) = 0;
  // Removes jobs finished, and uploads that no job or recipe uses made, longer ago than `age` of
  // service time, and events older than it that all known receivers have got; events twice as old
  // go in any case, since a receiver may be gone for good. Returns the number of jobs removed.
  virtual absl::StatusOr<int> RemoveOlderThan(absl::Duration age) = 0;
  // Digests that a job, recipe or upload names: the others may go from the artefact store.
  virtual absl::StatusOr<std::set<std::string>> NamedDigests() = 0;
};

// `file`: made if it is not there. FAILED_PRECONDITION: another process has it open, or it is of a
// newer version.
absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenSqliteJobStore(const std::string& file);
// `connection`: libpq's, e.g. "host=/run/postgresql dbname=sightline". Tables are made in schema
// `sightline` if they are not there. UNAVAILABLE: cannot connect.
absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenPostgresJobStore(
    const std::string& connection);

}  // namespace sightline
