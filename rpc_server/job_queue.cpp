// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/job_queue.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

template <typename... Text>
absl::Status QueueFull(const Text&... text) {
  return WithErrorInfo(absl::ResourceExhaustedError(absl::StrCat("the queue is full", text...)),
                       "QUEUE_FULL");
}

}  // namespace

absl::Status JobQueue::TakePlace(const std::string& peer) {
  const std::lock_guard lock(mutex_);
  if (jobs_ >= limits_.max_jobs) {
    return QueueFull(": ", jobs_, " jobs wait or run, at most ", limits_.max_jobs, " may");
  }
  const auto of_peer = jobs_of_peer_.find(peer);
  if (of_peer != jobs_of_peer_.end() && of_peer->second >= limits_.max_jobs_of_owner) {
    return QueueFull(" for ", peer, ": ", of_peer->second, " of its jobs wait or run, at most ",
                     limits_.max_jobs_of_owner, " may");
  }
  ++jobs_of_peer_[peer];
  ++jobs_;
  return absl::OkStatus();
}

absl::Status JobQueue::TakeBytes(int64_t bytes) {
  const std::lock_guard lock(mutex_);
  if (jobs_ > 1 && bytes_ + bytes > limits_.max_bytes) {
    return QueueFull(": the jobs that wait or run hold ", bytes_, " bytes, this one ", bytes,
                     " more, at most ", limits_.max_bytes, " may");
  }
  bytes_ += bytes;
  return absl::OkStatus();
}

void JobQueue::GiveBack(const std::string& peer, int64_t bytes) {
  const std::lock_guard lock(mutex_);
  --jobs_;
  bytes_ -= bytes;
  const auto of_peer = jobs_of_peer_.find(peer);
  if (--of_peer->second == 0) jobs_of_peer_.erase(of_peer);
}

absl::StatusOr<std::shared_ptr<const JobRoom>> JobQueue::Reserve(
    const std::string& peer, const std::function<int64_t()>& bytes) {
  const std::shared_ptr<JobRoom> room(new JobRoom(peer));
  if (absl::Status taken = TakePlace(peer); !taken.ok()) return taken;
  room->queue_ = this;  // from now on it gives back what it has
  const int64_t wanted = bytes();
  if (absl::Status taken = TakeBytes(wanted); !taken.ok()) return taken;
  room->bytes_ = wanted;
  return room;
}

JobRoom::~JobRoom() {
  if (queue_ != nullptr) queue_->GiveBack(peer_, bytes_);
}

absl::StatusOr<std::optional<JobRecord>> KnownJob(JobStore* jobs, const std::string& kind,
                                                  const std::string& request_id,
                                                  const std::function<std::string()>& fingerprint) {
  if (request_id.empty()) return std::nullopt;
  const std::vector<JobRecord> made = jobs->List(kind);
  const bool known = std::any_of(
      made.begin(), made.end(), [&](const JobRecord& job) { return job.request_id == request_id; });
  if (!known) return std::nullopt;
  // The store compares. The work is only kept if it forgets the job just now.
  const auto forgotten = [](JobContext&) -> absl::StatusOr<std::string> {
    return absl::UnavailableError("this request's job is not remembered any more: ask anew");
  };
  absl::StatusOr<JobRecord> job = jobs->Create(kind, request_id, fingerprint(), forgotten);
  if (!job.ok()) return job.status();
  return *std::move(job);
}

}  // namespace sightline
