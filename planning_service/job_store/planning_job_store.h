// SPDX-License-Identifier: Apache-2.0
// Stores jobs, recipes, uploads and events of the planning service durably.
//
// Every method is one transaction: a returned result is on disk, and a call that fails has
// happened either completely or not at all. Errors of all methods: UNAVAILABLE (the database does
// not answer; the change may have been made), RESOURCE_EXHAUSTED with reason DISK_FULL, DATA_LOSS
// (the database is damaged).
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
  // State of the job at the event: id, client, kind, request_id, priority, state, progress,
  // message, attempts, failure, results, revision.
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

// Number of an attempt of a job. Reports of an attempt that is not the job's current one are
// refused with ABORTED.
struct Attempt {
  std::string job_id;
  int number = 0;
};

class PlanningJobStore {
 public:
  virtual ~PlanningJobStore() = default;

  // To be called first by a service. If the database was restored from a backup, its event ids
  // continue above all ids given before (database_identity.h). Returns true if they were advanced.
  virtual absl::StatusOr<bool> BeginService() = 0;

  // Creates a job. A non-empty request_id that the client has used before returns its earlier job;
  // ALREADY_EXISTS, reason REQUEST_ID_REUSED: the fingerprint differs. RESOURCE_EXHAUSTED, reason
  // QUOTA_EXCEEDED; never for such a repetition.
  virtual absl::StatusOr<PlanningJob> Create(const NewPlanningJob& job,
                                             const ClientQuota& quota) = 0;
  // NOT_FOUND, reason JOB_UNKNOWN.
  virtual absl::StatusOr<PlanningJob> Get(const std::string& job_id) = 0;
  // Jobs, newest first, without `task` and `files`. As in Get and Create, queued jobs have
  // `jobs_ahead`. With one worker, Claim returns exactly these jobs first, unless new jobs come or
  // a client is at its quota. With several workers, clients with fewer running jobs go first.
  virtual absl::StatusOr<std::vector<PlanningJob>> List(const PlanningJobFilter& filter) = 0;
  // Cancels a queued job at once and asks a running one to stop; finished jobs do not change.
  virtual absl::StatusOr<PlanningJob> RequestCancel(const std::string& job_id) = 0;
  // Waits until the job's revision exceeds `revision` or the timeout passes; returns the job.
  virtual absl::StatusOr<PlanningJob> WaitForChange(const std::string& job_id, int64_t revision,
                                                    absl::Duration timeout) = 0;
  // Numbers of jobs by state, of a client or of all clients.
  struct Counts {
    int queued = 0;
    int running = 0;
    int64_t stored_bytes = 0;
  };
  virtual absl::StatusOr<Counts> Count(const std::optional<std::string>& client) = 0;

  // Takes the next job to run: by highest priority, then by the client with the fewest running
  // jobs, then by age. Clients that run max_running_jobs are skipped. The job becomes RUNNING and
  // belongs to this store's owner.
  virtual absl::StatusOr<std::optional<PlanningJob>> Claim(
      const std::function<ClientQuota(const std::string& client)>& quota_of) = 0;
  // Returns true if the job was asked to stop. Progress never decreases. Makes at most one event of
  // type progress per job and second (steady clock).
  virtual absl::StatusOr<bool> ReportProgress(const Attempt& attempt, double progress,
                                              const std::string& message) = 0;
  virtual absl::Status Succeed(const Attempt& attempt, const std::vector<JobFile>& results) = 0;
  virtual absl::Status Fail(const Attempt& attempt, const JobFailure& failure) = 0;
  virtual absl::Status MarkCancelled(const Attempt& attempt) = 0;
  // Puts the job back into the queue, at its old place. `crashed`: the attempt ended without a
  // stated reason and is counted. `advanced`: it got further than earlier attempts; the count
  // restarts.
  virtual absl::Status Requeue(const Attempt& attempt, bool crashed, bool advanced) = 0;
  // Puts running jobs whose owner is gone back into the queue; returns their number. An embedded
  // store has one owner at a time. A shared store recognises living owners by their sessions with
  // the database, not by clocks.
  virtual absl::StatusOr<int> RequeueOrphans() = 0;

  // NOT_FOUND, reason RECIPE_UNKNOWN.
  virtual absl::StatusOr<Recipe> GetRecipe(const std::string& client,
                                           const std::string& recipe_id) = 0;
  virtual absl::Status PutRecipe(const Recipe& recipe, const ClientQuota& quota) = 0;
  virtual absl::Status DeleteRecipe(const std::string& client, const std::string& recipe_id) = 0;
  virtual absl::StatusOr<int> CountRecipes(const std::string& client) = 0;

  // Records that the client uploaded the file. RESOURCE_EXHAUSTED, reason QUOTA_EXCEEDED.
  virtual absl::Status AddUpload(const std::string& client, const JobFile& file,
                                 const ClientQuota& quota) = 0;
  // Size of a file that the client has uploaded or has in a job or recipe; nullopt: no such file.
  virtual absl::StatusOr<std::optional<int64_t>> FindFile(const std::string& client,
                                                          const std::string& digest) = 0;

  // Events after `sequence` in order, of one job or of all.
  virtual absl::StatusOr<std::vector<JobEvent>> Events(int64_t after_sequence,
                                                       const std::optional<std::string>& job_id,
                                                       int limit) = 0;
  // Waits until there is an event after `sequence` or the timeout passes.
  virtual void WaitForEvent(int64_t after_sequence, absl::Duration timeout) = 0;
  // Largest event id given so far; 0: none.
  virtual absl::StatusOr<int64_t> NewestEvent() = 0;
  // True if an event has this id; false if the event was removed or lost by a restore.
  virtual absl::StatusOr<bool> HasEvent(int64_t sequence) = 0;
  // Sequence of the last event that the receiver has; 0 at first.
  virtual absl::StatusOr<int64_t> EventCursor(const std::string& receiver) = 0;
  virtual absl::Status SetEventCursor(const std::string& receiver, int64_t sequence) = 0;
  // True for at most one process per receiver, as long as its session lives: this process delivers.
  virtual bool HoldsReceiver(const std::string& receiver) = 0;

  // Advances the service time: the time that the service has run, kept across restarts. It follows
  // a steady clock, so that a jump of the wall clock ages nothing. Retention is measured in it.
  virtual absl::Status AdvanceServiceTime(absl::Duration by) = 0;
  // Removes, if older than `age` of service time: finished jobs, uploads that no job or recipe
  // uses, and events that all known receivers have. Events older than 2 `age` are always removed,
  // because a receiver may be gone for good. Returns the number of jobs removed.
  virtual absl::StatusOr<int> RemoveOlderThan(absl::Duration age) = 0;
  // Digests that a job, recipe or upload names; all others may be removed from the artefact store.
  virtual absl::StatusOr<std::set<std::string>> NamedDigests() = 0;
};

// Opens `file`, or makes it. FAILED_PRECONDITION: another process has it open, or it is of a newer
// version.
absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenSqliteJobStore(const std::string& file);
// `connection`: connection text of libpq, e.g. "host=/run/postgresql dbname=sightline". Makes
// missing tables in the schema `sightline`. UNAVAILABLE: cannot connect.
absl::StatusOr<std::unique_ptr<PlanningJobStore>> OpenPostgresJobStore(
    const std::string& connection);

}  // namespace sightline
