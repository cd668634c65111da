// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cassert>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <random>
#include <string>
#include <thread>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/admission/shared_limit.h"
#include "core/job/job_store.h"
#include "core/parallel/exception_status.h"
#include "core/status/status_macros.h"
#include "core/text/printable.h"
#include "core/trace/trace_context.h"

namespace sightline {
namespace {

template <typename... Text>
absl::Status QueueFull(const Text&... text) {
  return absl::ResourceExhaustedError(absl::StrCat("the queue is full", text...));
}

absl::Status TooManyJobs(const std::string& owner, const Shortage& shortage) {
  return QueueFull(shortage.of_owner ? absl::StrCat(" for ", owner) : "", ": ", shortage.held,
                   shortage.of_owner ? " of its jobs" : " jobs", " wait or run, at most ",
                   shortage.limit, " may");
}

absl::Status TooManyBytes(const std::string& owner, int64_t bytes, const Shortage& shortage) {
  return QueueFull(shortage.of_owner ? absl::StrCat(" for ", owner, ": its") : ": the",
                   " jobs that wait or run hold ", shortage.held, " bytes, this one ", bytes,
                   " more, at most ", shortage.limit, " may");
}

struct Room : JobRoom {
  SharedLimit::Share job;
  SharedLimit::Share bytes;
};

// Uses std::mutex, not absl::Mutex: the thread sanitizer supports it without a rebuilt library.
class InMemoryJobStore : public JobStore {
 public:
  InMemoryJobStore(int workers, const JobLimits& limits)
      : jobs_limit_(limits.max_jobs, limits.max_jobs_of_owner),
        bytes_limit_(limits.max_bytes, limits.max_bytes_of_owner) {
    assert(workers > 0);
    for (int i = 0; i < std::max(workers, 1); ++i) threads_.emplace_back([this] { Work(); });
  }

  ~InMemoryJobStore() override {
    {
      std::unique_lock lock(mutex_);
      stopping_ = true;
      const auto jobs = order_;  // finishing a job may drop an old one
      for (const auto& [number, job] : jobs) {
        if (!job->record.finished()) CancelLocked(*job);
      }
      queued_.notify_all();
      changed_.notify_all();
      // Threads that still wait for a change must leave before the members are destroyed.
      changed_.wait(lock, [this] { return waiting_ == 0; });
    }
    for (std::thread& thread : threads_) thread.join();
  }

  absl::StatusOr<std::unique_ptr<JobRoom>> Reserve(const std::string& owner,
                                                   const std::function<int64_t()>& bytes) override {
    auto room = std::make_unique<Room>();
    room->job = jobs_limit_.Of(owner);
    if (const auto shortage = room->job.Grow(1)) return TooManyJobs(owner, *shortage);
    room->bytes = bytes_limit_.Of(owner);
    const int64_t wanted = bytes();
    if (const auto shortage = room->bytes.Grow(wanted)) {
      return TooManyBytes(owner, wanted, *shortage);
    }
    return room;
  }

  absl::StatusOr<std::optional<JobRecord>> Find(
      const std::string& kind, const std::string& request_id,
      const std::function<std::string()>& fingerprint) const override {
    std::shared_ptr<const Job> job;
    {
      const std::lock_guard lock(mutex_);
      job = KnownLocked(kind, request_id);
    }
    if (job == nullptr) return std::nullopt;
    // fingerprint() takes time, so the mutex is not held.
    SIGHTLINE_RETURN_IF_ERROR(CheckSame(*job, fingerprint()));
    const std::lock_guard lock(mutex_);
    return job->record;
  }

  absl::StatusOr<JobRecord> Create(const std::string& kind, const std::string& request_id,
                                   const std::string& fingerprint, JobWork work,
                                   std::unique_ptr<JobRoom> room) override {
    std::lock_guard lock(mutex_);
    if (const auto known = KnownLocked(kind, request_id); known != nullptr) {
      SIGHTLINE_RETURN_IF_ERROR(CheckSame(*known, fingerprint));
      return known->record;
    }
    if (stopping_) return absl::UnavailableError("the job store is shutting down");
    auto job = std::make_shared<Job>();
    job->number = next_number_++;
    job->fingerprint = fingerprint;
    job->work = std::move(work);
    job->room = std::move(room);
    job->traceparent = CurrentTraceparent();
    job->record.kind = kind;
    job->record.request_id = request_id;
    job->record.job_id = NewId(kind);
    job->record.revision = 1;
    jobs_[job->record.job_id] = job;
    order_[job->number] = job;
    if (!request_id.empty()) requests_[{kind, request_id}] = job->record.job_id;
    queue_.push_back(job);
    queued_.notify_one();
    return job->record;
  }

  absl::StatusOr<JobRecord> Get(const std::string& job_id) const override {
    std::lock_guard lock(mutex_);
    const auto job = jobs_.find(job_id);
    if (job == jobs_.end()) return Unknown(job_id);
    return job->second->record;
  }

  std::vector<JobRecord> List(const std::string& kind) const override {
    std::lock_guard lock(mutex_);
    std::vector<JobRecord> records;
    for (const auto& [number, job] : order_) {
      if (kind.empty() || job->record.kind == kind) records.push_back(job->record);
    }
    return records;
  }

  absl::StatusOr<JobRecord> Cancel(const std::string& job_id) override {
    std::lock_guard lock(mutex_);
    const auto found = jobs_.find(job_id);
    if (found == jobs_.end()) return Unknown(job_id);
    const std::shared_ptr<Job> job = found->second;
    if (!job->record.finished()) CancelLocked(*job);
    return job->record;
  }

  absl::StatusOr<JobRecord> WaitForChange(const std::string& job_id, int64_t revision,
                                          absl::Duration timeout) const override {
    std::unique_lock lock(mutex_);
    const auto found = jobs_.find(job_id);
    if (found == jobs_.end()) return Unknown(job_id);
    const std::shared_ptr<Job> job = found->second;  // stays, even if the store forgets it
    const auto ready = [&] { return job->record.revision > revision || stopping_; };
    ++waiting_;
    // Very long waits are cut, because the clock's arithmetic would overflow.
    const auto bounded = absl::ToChronoMilliseconds(
        std::clamp(timeout, absl::ZeroDuration(), absl::Hours(24 * 365)));
    changed_.wait_until(lock, std::chrono::steady_clock::now() + bounded, ready);
    --waiting_;
    JobRecord record = job->record;
    if (stopping_ && waiting_ == 0) changed_.notify_all();
    return record;
  }

 private:
  struct Job {
    int64_t number = 0;
    std::string fingerprint;
    JobWork work;
    std::unique_ptr<JobRoom> room;
    std::string traceparent;  // of the request that made it
    JobRecord record;
    std::atomic<bool> cancelled{false};
  };

  class Context : public JobContext {
   public:
    Context(InMemoryJobStore& store, Job& job) : store_(store), job_(job) {}
    void ReportProgress(double progress, const std::string& message) override {
      std::lock_guard lock(store_.mutex_);
      // Progress never decreases; NaN has no effect.
      job_.record.progress = std::max(job_.record.progress, std::min(progress, 1.0));
      job_.record.message = message;
      store_.Changed(job_);
    }
    const std::atomic<bool>& cancelled() const override { return job_.cancelled; }

   private:
    InMemoryJobStore& store_;
    Job& job_;
  };

  static absl::Status Unknown(const std::string& job_id) {
    return absl::NotFoundError(absl::StrCat("no job \"", Printable(job_id.substr(0, 64)), "\""));
  }

  static absl::Status CheckSame(const Job& job, const std::string& fingerprint) {
    if (job.fingerprint == fingerprint) return absl::OkStatus();
    return absl::AlreadyExistsError(absl::StrCat("request_id \"", job.record.request_id,
                                                 "\" was used for another ", job.record.kind));
  }

  // Random, so that an id from before a restart never names another job.
  std::string NewId(const std::string& kind) {
    return absl::StrFormat("%s-%08x%08x%08x", kind, random_(), random_(), random_());
  }

  // The functions below are called with the mutex held.

  // Null: (kind, request_id) has made no job that is remembered.
  std::shared_ptr<Job> KnownLocked(const std::string& kind, const std::string& request_id) const {
    if (request_id.empty()) return nullptr;
    const auto known = requests_.find({kind, request_id});
    return known == requests_.end() ? nullptr : jobs_.at(known->second);
  }

  void Changed(Job& job) {
    ++job.record.revision;
    changed_.notify_all();
  }

  void CancelLocked(Job& job) {
    if (job.cancelled.exchange(true)) return;
    if (job.record.state != JobState::kQueued) {
      Changed(job);  // Work() sets the state once the work has returned
      return;
    }
    queue_.erase(std::remove_if(queue_.begin(), queue_.end(),
                                [&](const auto& queued) { return queued.get() == &job; }),
                 queue_.end());
    Finish(job, absl::CancelledError("cancelled before it started"));
  }

  void Finish(Job& job, const absl::StatusOr<std::string>& result) {
    job.work = nullptr;
    job.room = nullptr;
    if (job.cancelled) {
      job.record.state = JobState::kCancelled;
      job.record.error = absl::CancelledError("cancelled");
      if (result.ok()) job.record.result_key = *result;
    } else if (result.ok()) {
      job.record.state = JobState::kSucceeded;
      job.record.result_key = *result;
      job.record.progress = 1;
    } else {
      job.record.state = JobState::kFailed;
      job.record.error = result.status();
    }
    Changed(job);
    finished_.push_back(job.number);
    while (finished_.size() > size_t{kKeptFinishedJobs}) {
      const auto oldest = order_.find(finished_.front());
      finished_.pop_front();
      const std::shared_ptr<Job> dropped = oldest->second;
      order_.erase(oldest);
      jobs_.erase(dropped->record.job_id);
      if (!dropped->record.request_id.empty()) {
        requests_.erase({dropped->record.kind, dropped->record.request_id});
      }
    }
  }

  void Work() {
    std::unique_lock lock(mutex_);
    while (true) {
      queued_.wait(lock, [this] { return stopping_ || !queue_.empty(); });
      if (queue_.empty()) return;  // stopping: everything queued was cancelled
      const std::shared_ptr<Job> job = queue_.front();
      queue_.pop_front();
      job->record.state = JobState::kRunning;
      Changed(*job);
      JobWork work = std::move(job->work);
      lock.unlock();
      absl::StatusOr<std::string> result = absl::InternalError("no result");
      try {
        const ScopedTrace trace(job->traceparent);
        Context context(*this, *job);
        result = work(context);
      } catch (...) {
        result = StatusOfException();
      }
      work = nullptr;  // its captures are destroyed without the mutex
      lock.lock();
      Finish(*job, result);
    }
  }

  mutable std::mutex mutex_;
  std::condition_variable queued_;
  mutable std::condition_variable changed_;
  mutable int waiting_ = 0;
  bool stopping_ = false;
  SharedLimit jobs_limit_;
  SharedLimit bytes_limit_;
  int64_t next_number_ = 0;
  std::random_device random_;
  std::map<std::string, std::shared_ptr<Job>> jobs_;
  std::map<int64_t, std::shared_ptr<Job>> order_;
  std::map<std::pair<std::string, std::string>, std::string> requests_;
  std::deque<std::shared_ptr<Job>> queue_;
  std::deque<int64_t> finished_;
  std::vector<std::thread> threads_;
};

}  // namespace

std::unique_ptr<JobStore> MakeInMemoryJobStore(int workers, const JobLimits& limits) {
  return std::make_unique<InMemoryJobStore>(workers, limits);
}

}  // namespace sightline
