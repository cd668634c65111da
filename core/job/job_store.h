// SPDX-License-Identifier: Apache-2.0
// Long operations as jobs. One interface for every service; this store keeps them in memory.
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
  std::string result_key;  // of a cancelled job, if any: of its partial result
  absl::Status error;
  int64_t revision = 0;  // grows with every change

  bool finished() const { return state >= JobState::kSucceeded; }
};

// Handed to the running work.
class JobContext {
 public:
  virtual ~JobContext() = default;
  virtual void ReportProgress(double progress, const std::string& message) = 0;
  // Work stops within 100 ms of this becoming true.
  virtual const std::atomic<bool>& cancelled() const = 0;
};

// Returns the result key; if cancelled, CANCELLED or the key of the partial result.
using JobWork = std::function<absl::StatusOr<std::string>(JobContext&)>;

// Room for one job, from before its request is parsed until it is finished. Given back when it
// goes.
class JobRoom {
 public:
  virtual ~JobRoom() = default;
};

class JobStore {
 public:
  virtual ~JobStore() = default;
  // Room for one job of `owner`, e.g. a peer, whose work holds on to `bytes()` of memory; that is
  // only asked if the number of jobs allows one more. What a request costs before Create, its
  // parsing and hashing, is only spent on those that have room. RESOURCE_EXHAUSTED: there is none;
  // jobs that are being made count as those that wait or run.
  virtual absl::StatusOr<std::unique_ptr<JobRoom>> Reserve(
      const std::string& owner, const std::function<int64_t()>& bytes) = 0;
  // The job that (kind, request_id) has made; it needs no room again. Nothing for a new or empty
  // id. ALREADY_EXISTS: that job was of another `fingerprint()`, which is only asked of ids that
  // are known.
  virtual absl::StatusOr<std::optional<JobRecord>> Find(
      const std::string& kind, const std::string& request_id,
      const std::function<std::string()>& fingerprint) const = 0;
  // Queues `work` and returns at once. A known (kind, request_id) returns that job and drops
  // `work`; ALREADY_EXISTS if it was made with another `fingerprint`. An empty request_id is
  // always new. The job keeps its `room`; without one it counts towards no limit.
  virtual absl::StatusOr<JobRecord> Create(const std::string& kind, const std::string& request_id,
                                           const std::string& fingerprint, JobWork work,
                                           std::unique_ptr<JobRoom> room = nullptr) = 0;
  virtual absl::StatusOr<JobRecord> Get(const std::string& job_id) const = 0;
  // In order of creation; empty kind: all.
  virtual std::vector<JobRecord> List(const std::string& kind) const = 0;
  virtual absl::StatusOr<JobRecord> Cancel(const std::string& job_id) = 0;
  // Waits until the job's revision exceeds `revision` or the timeout passes; returns the job.
  virtual absl::StatusOr<JobRecord> WaitForChange(const std::string& job_id, int64_t revision,
                                                  absl::Duration timeout) const = 0;
};

// Finished jobs that a store remembers.
inline constexpr int kKeptFinishedJobs = 1000;

// Limits on the jobs that are admitted at a time.
struct JobLimits {
  int64_t max_jobs = std::numeric_limits<int64_t>::max();
  int64_t max_jobs_of_owner = std::numeric_limits<int64_t>::max();
  // A job that alone exceeds them has room while no other has.
  int64_t max_bytes = std::numeric_limits<int64_t>::max();
  int64_t max_bytes_of_owner = std::numeric_limits<int64_t>::max();
};

// Runs at most `workers` jobs at a time. Keeps the last kKeptFinishedJobs finished jobs. Work that
// throws fails: RESOURCE_EXHAUSTED for lack of memory, INTERNAL otherwise. The destructor cancels
// running jobs and waits for them.
std::unique_ptr<JobStore> MakeInMemoryJobStore(int workers, const JobLimits& limits = {});

}  // namespace sightline
