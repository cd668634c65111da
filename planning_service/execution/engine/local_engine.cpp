// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <numeric>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "planning_service/execution/engine/compute_engine.h"
#include "planning_service/execution/engine/task_folder.h"

namespace sightline {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(100);

JobProcessOptions ProcessOf(const AttemptOptions& options, std::vector<std::string> arguments) {
  JobProcessOptions process;
  process.program = options.program;
  process.arguments = std::move(arguments);
  process.folder = options.folder + "/in";
  process.temporary_folder = options.folder + "/tmp";
  process.lock_fd = options.lock_fd;
  process.max_memory_bytes = options.max_memory_bytes;
  process.max_time = options.max_time;
  return process;
}

// The shards of a job, each watched by a thread.
class Parts {
 public:
  explicit Parts(const AttemptOptions& options)
      : progress_(options.commands.parts.size()), running_(options.commands.parts.size()) {
    for (size_t i = 0; i < options.commands.parts.size(); ++i) {
      threads_.emplace_back([this, i, process = ProcessOf(options, options.commands.parts[i])] {
        auto end = RunJobProcess(process, [this, i](const JobProgress& progress) {
          std::lock_guard lock(mutex_);
          progress_[i] = progress;
          return !stopping_;
        });
        std::lock_guard lock(mutex_);
        --running_;
        if (end.ok() && end->kind == JobProcessEnd::Kind::kDone) {
          progress_[i].fraction = 1;
        } else if (!first_bad_end_) {
          // The job has failed: stop the other shards and ignore how they end.
          first_bad_end_ = std::move(end);
          stopping_ = true;
        }
        changed_.notify_all();
      });
    }
  }

  // How the first failed shard ended; empty if all succeeded.
  std::optional<absl::StatusOr<JobProcessEnd>> Wait(const ProgressCallback& wish) {
    std::unique_lock lock(mutex_);
    while (running_ > 0) {
      changed_.wait_for(lock, kPoll, [this] { return running_ == 0; });
      const JobProgress progress = ProgressOfParts(progress_, {});
      lock.unlock();
      const bool go_on = wish(progress) == Wish::kGoOn;
      lock.lock();
      if (!go_on) stopping_ = true;
    }
    lock.unlock();
    for (std::thread& thread : threads_) thread.join();
    return first_bad_end_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<JobProgress> progress_;
  size_t running_;
  bool stopping_ = false;
  std::optional<absl::StatusOr<JobProcessEnd>> first_bad_end_;
  std::vector<std::thread> threads_;
};

class LocalEngine final : public ComputeEngine {
 public:
  absl::StatusOr<JobProcessEnd> Run(const AttemptOptions& options,
                                    const ProgressCallback& wish) override {
    // An earlier service may have left tasks of this job running on a cluster.
    if (RevokeTasks(options.folder)) AwaitRevokedTasks(wish);
    if (const auto failure = PrepareFailure(options)) return *failure;
    const size_t count = options.commands.parts.size();
    if (count > 0) {
      if (auto bad_end = Parts(options).Wait(wish)) return *std::move(bad_end);
    }
    return RunJobProcess(ProcessOf(options, options.commands.conclusion), [&](const JobProgress&
                                                                                  progress) {
      const JobProgress whole = ProgressOfParts(std::vector<JobProgress>(count, {1, ""}), progress);
      return wish(whole) == Wish::kGoOn;
    });
  }
};

}  // namespace

std::unique_ptr<ComputeEngine> MakeLocalEngine() { return std::make_unique<LocalEngine>(); }

}  // namespace sightline
