// SPDX-License-Identifier: Apache-2.0
// Jobs: long operations of a service. One interface for all services; the store here is in memory.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sightline {

enum class JobState { kQueued, kRunning, kSucceeded, kFailed, kCancelled };

struct JobRecord {
  std::string job_id;
  std::string kind;
  std::string request_id;
  JobState state = JobState::kQueued;
  double progress = 0;  // [0, 1]
  std::string message;
  std::string result_key;  // for a cancelled job: key of its partial result, if any
  absl::Status error;
  int64_t revision = 0;  // grows with every change

  bool finished() const { return state >= JobState::kSucceeded; }
};

// Interface for running work to its job.
class JobContext {
 public:
  virtual ~JobContext() = default;
  virtual void ReportProgress(double progress, const std::string& message) = 0;
  // Work stops within 100 ms of this becoming true.
  virtual const std::atomic<bool>& cancelled() const = 0;
};

// Work of a job. Returns the result key; if cancelled, CANCELLED or the key of a partial result.
using JobWork = std::function<absl::StatusOr<std::string>(JobContext&)>;

// Reservation for one job, held from before its request is parsed until the job is finished. The
// destructor gives it back.
class JobRoom {
 public:
  virtual ~JobRoom() = default;
};

class JobStore {
 public:
  virtual ~JobStore() = default;
  // Reserves room for one job of `owner` (for example a peer). `bytes()` returns the memory [bytes]
  // that the job will hold; it is called only if the number of jobs is below the limit. To be
  // called before a request is parsed and hashed. RESOURCE_EXHAUSTED: a limit is reached by jobs
  // that are reserved, wait or run.
  virtual absl::StatusOr<std::unique_ptr<JobRoom>> Reserve(
      const std::string& owner, const std::function<int64_t()>& bytes) = 0;
  // The job that an earlier request with the same (kind, request_id) has made; it needs no further
  // room. nullopt: the id is new or empty. ALREADY_EXISTS: that job has another fingerprint.
  // `fingerprint()` is called only if the id is known.
  virtual absl::StatusOr<std::optional<JobRecord>> Find(
      const std::string& kind, const std::string& request_id,
      const std::function<std::string()>& fingerprint) const = 0;
  // Queues `work` and returns at once. If (kind, request_id) is known, drops `work` and returns the
  // earlier job; ALREADY_EXISTS: that job has another `fingerprint`. An empty request_id is always
  // new. The job keeps its `room`; a job without room counts towards no limit.
  virtual absl::StatusOr<JobRecord> Create(const std::string& kind, const std::string& request_id,
                                           const std::string& fingerprint, JobWork work,
                                           std::unique_ptr<JobRoom> room = nullptr) = 0;
  virtual absl::StatusOr<JobRecord> Get(const std::string& job_id) const = 0;
  // Jobs of a kind (empty: of all kinds) in order of creation.
  virtual std::vector<JobRecord> List(const std::string& kind) const = 0;
  virtual absl::StatusOr<JobRecord> Cancel(const std::string& job_id) = 0;
  // Waits until the job's revision exceeds `revision` or the timeout passes; returns the job.
  virtual absl::StatusOr<JobRecord> WaitForChange(const std::string& job_id, int64_t revision,
                                                  absl::Duration timeout) const = 0;
};

// Number of finished jobs that a store keeps.
inline constexpr int kKeptFinishedJobs = 1000;

// Limits on the jobs that are reserved, wait or run at the same time.
struct JobLimits {
  int64_t max_jobs = std::numeric_limits<int64_t>::max();
  int64_t max_jobs_of_owner = std::numeric_limits<int64_t>::max();
  // A job that alone exceeds one of these is admitted while no other job counts towards it.
  int64_t max_bytes = std::numeric_limits<int64_t>::max();
  int64_t max_bytes_of_owner = std::numeric_limits<int64_t>::max();
};

// Runs at most `workers` jobs at a time. Keeps the last kKeptFinishedJobs finished jobs. A job
// whose work throws fails: with RESOURCE_EXHAUSTED if memory ran out, else INTERNAL. The destructor
// cancels running jobs and waits for them.
std::unique_ptr<JobStore> MakeInMemoryJobStore(int workers, const JobLimits& limits = {});

}  // namespace sightline
