// SPDX-License-Identifier: Apache-2.0
// Room for the jobs of a server, taken before anything is made of their requests.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/job/job_store.h"

namespace sightline {

// What a job takes of the queue, from before its request is parsed until its work is dropped: the
// work keeps it. Given back when it goes.
class JobRoom;

// The only limit of the jobs of its server, whose store has none of its own: what a store refuses
// has been parsed and hashed before. Thread-safe; must outlive its rooms.
class JobQueue {
 public:
  // Jobs that are being made count as those that wait or run.
  explicit JobQueue(const JobLimits& limits) : limits_(limits) {}

  // Room for one job of `peer`, which holds on to `bytes()` of memory; that is only asked if the
  // number of jobs allows one more. RESOURCE_EXHAUSTED (QUEUE_FULL): there is none. A job that is
  // too large for the limit on bytes alone has room while there is no other.
  absl::StatusOr<std::shared_ptr<const JobRoom>> Reserve(const std::string& peer,
                                                         const std::function<int64_t()>& bytes);

 private:
  friend class JobRoom;

  absl::Status TakePlace(const std::string& peer);
  absl::Status TakeBytes(int64_t bytes);
  void GiveBack(const std::string& peer, int64_t bytes);

  const JobLimits limits_;
  std::mutex mutex_;
  int64_t jobs_ = 0;
  int64_t bytes_ = 0;
  std::map<std::string, int64_t> jobs_of_peer_;
};

class JobRoom {
 public:
  ~JobRoom();
  JobRoom(const JobRoom&) = delete;
  JobRoom& operator=(const JobRoom&) = delete;

 private:
  friend class JobQueue;
  explicit JobRoom(std::string peer) : peer_(std::move(peer)) {}

  const std::string peer_;
  JobQueue* queue_ = nullptr;  // once it has a place
  int64_t bytes_ = 0;
};

// The job that (kind, request_id) has made before; it needs no room again. Nothing for a new or
// empty id. ALREADY_EXISTS: that job was of another `fingerprint()`, which is only asked of ids
// that are known.
absl::StatusOr<std::optional<JobRecord>> KnownJob(JobStore* jobs, const std::string& kind,
                                                  const std::string& request_id,
                                                  const std::function<std::string()>& fingerprint);

}  // namespace sightline
