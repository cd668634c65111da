// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/job_runner.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <functional>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "core/trace/trace_context.h"
#include "planning_service/execution/server_paths.h"
#include "planning_service/task/option_fields.h"
#include "planning_service/task/planning_task.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr absl::Duration kIdlePause = absl::Milliseconds(200);
constexpr absl::Duration kFullDiskPause = absl::Seconds(2);
constexpr absl::Duration kFirstRetry = absl::Milliseconds(200);
constexpr absl::Duration kLongestRetry = absl::Seconds(10);
constexpr absl::Duration kReportInterval = absl::Milliseconds(250);
// Most attempts in a row that end without a stated reason and without progress. Few if the job
// itself is likely at fault, many if another process killed it or a server that it needs.
constexpr int kMostCrashes = 8;
constexpr int kMostKills = 100;
constexpr int kMostResults = 100000;
// Number of times that the runner waits for processes of an earlier attempt to end.
constexpr int kLockTries = 50;
constexpr absl::Duration kLockPause = absl::Milliseconds(200);

// A job's folder belongs to the holder of the lock on this file: the runner and the processes of
// the attempt, which inherit the lock. If a runner was killed, the processes of its attempt may
// hold the lock a moment longer.
class FolderLock {
 public:
  explicit FolderLock(const std::string& file)
      : fd_(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {}
  ~FolderLock() {
    if (fd_ >= 0) close(fd_);
  }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  bool Try() const { return fd_ >= 0 && flock(fd_, LOCK_EX | LOCK_NB) == 0; }
  int fd() const { return fd_; }

 private:
  int fd_;
};

absl::Status EmptyFolder(const fs::path& folder) {
  std::error_code error;
  fs::remove_all(folder, error);
  fs::create_directories(folder, error);
  if (!error) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(folder.string(), ": ", error.message()));
}

// True for errors that say nothing about the task: a server ended, or the command was told to stop.
bool IsPassing(absl::StatusCode code) {
  return code == absl::StatusCode::kUnavailable || code == absl::StatusCode::kCancelled ||
         code == absl::StatusCode::kAborted;
}

// HasRoom() may be true again by now, because the job's own unfinished file is gone.
bool RanOutOfDisk(const JobFailure& failure) {
  return failure.code == absl::StatusCode::kResourceExhausted &&
         absl::StrContains(failure.message, std::strerror(ENOSPC));
}

// Adds an option before the command to all commands of the job, unless its value is empty.
void AddGlobalOption(const std::string& name, const std::string& value, TaskCommands* commands) {
  if (value.empty()) return;
  const std::string option = absl::StrCat(name, "=", value);
  for (std::vector<std::string>& part : commands->parts) part.insert(part.begin(), option);
  commands->conclusion.insert(commands->conclusion.begin(), option);
}

// `folder`: the job's.
ServerPaths PathsOf(const JobRunnerOptions& options, const std::string& folder) {
  std::vector<std::string> folders = options.hidden_folders;
  folders.push_back(options.work_folder);
  folders.push_back(options.step_cache_folder);
  for (std::string& program : FoldersOfProgram(options.program)) {
    folders.push_back(std::move(program));
  }
  return ServerPaths(folder, folders);
}

}  // namespace

JobRunner::JobRunner(JobRunnerOptions options, PlanningJobStore* store, ArtefactStore* artefacts,
                     ClientAccess* access, ComputeEngine* engine)
    : options_(std::move(options)),
      store_(store),
      artefacts_(artefacts),
      access_(access),
      engine_(engine) {}

JobRunner::~JobRunner() { Stop(); }

void JobRunner::Start() {
  for (int i = 0; i < options_.workers; ++i) threads_.emplace_back([this] { Work(); });
}

void JobRunner::Stop() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  stop_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

bool JobRunner::Pause(absl::Duration time) {
  std::unique_lock lock(mutex_);
  stop_.wait_for(lock, absl::ToChronoMilliseconds(time), [this] { return stopping_.load(); });
  return !stopping_;
}

void JobRunner::Work() {
  absl::Duration retry = kFirstRetry;
  while (!stopping_) {
    if (!artefacts_->HasRoom()) {
      Pause(kFullDiskPause);
      continue;
    }
    auto job =
        store_->Claim([this](const std::string& client) { return access_->QuotaOf(client); });
    if (!job.ok()) {
      spdlog::warn("event=claim_failed error=\"{}\"", job.status().ToString());
      Pause(retry);
      retry = std::min(2 * retry, kLongestRetry);
      continue;
    }
    retry = kFirstRetry;
    if (*job) {
      Run(**job);
    } else {
      Pause(kIdlePause);
    }
  }
}

void JobRunner::Tell(const std::string& what, const std::function<absl::Status()>& tell) {
  absl::Duration retry = kFirstRetry;
  while (true) {
    const absl::Status status = tell();
    if (status.ok()) return;
    // Another runner has the job, or the job was removed: this attempt is obsolete.
    if (absl::IsAborted(status) || absl::IsNotFound(status)) {
      spdlog::warn("event=attempt_superseded what={} error=\"{}\"", what, status.ToString());
      return;
    }
    spdlog::warn("event=store_failed what={} error=\"{}\"", what, status.ToString());
    // When the store answers again, it finds the job running without an owner and requeues it.
    if (!Pause(retry)) return;
    retry = std::min(2 * retry, kLongestRetry);
  }
}

absl::Status JobRunner::Prepare(const PlanningJob& job, const std::string& folder) {
  v1::PlanningTask task;
  if (!task.ParseFromString(job.task)) return absl::DataLossError("the kept task cannot be read");
  const fs::path base(folder);
  SIGHTLINE_RETURN_IF_ERROR(EmptyFolder(base / "in"));
  for (const JobFile& file : job.files) {
    const fs::path path = base / "in" / file.name;
    std::error_code error;
    fs::create_directories(path.parent_path(), error);
    SIGHTLINE_RETURN_IF_ERROR(artefacts_->Materialise(file.digest, path.string()));
  }
  SIGHTLINE_RETURN_IF_ERROR(WriteTaskFiles(task, (base / "in").string()));
  // Complete images of an earlier attempt are kept. Other kinds make all results at the end.
  if (job.kind != "render") {
    SIGHTLINE_RETURN_IF_ERROR(EmptyFolder(base / "out"));
  }
  std::error_code error;
  fs::create_directories(base / "checkpoint", error);
  return absl::OkStatus();
}

void JobRunner::Run(const PlanningJob& job) {
  const ScopedTrace trace(job.traceparent);
  const Attempt attempt{job.job_id, job.attempts};
  const std::string folder = absl::StrCat(options_.work_folder, "/", job.job_id);
  std::error_code error;
  fs::create_directories(folder, error);
  const FolderLock lock(folder + "/lock");
  bool locked = lock.Try();
  for (int i = 0; !locked && i < kLockTries && Pause(kLockPause); ++i) locked = lock.Try();
  if (!locked) {
    Tell("requeue", [&] { return store_->Requeue(attempt, /*crashed=*/false, false); });
    return;
  }
  spdlog::info("event=job_started job={} kind={} client=\"{}\" attempt={}", job.job_id, job.kind,
               job.client, job.attempts);
  v1::PlanningTask task;
  task.ParseFromString(job.task);
  AttemptOptions options;
  options.name = job.job_id;
  options.program = options_.program;
  options.folder = folder;
  options.commands = SplitTask(task, "../out", "../checkpoint", options_.parts);
  // The servers of the job's commands name the request in their logs, too.
  AddGlobalOption("--traceparent", job.traceparent, &options.commands);
  AddGlobalOption("--step-cache", options_.step_cache_folder, &options.commands);
  options.prepare = [&] { return Prepare(job, folder); };
  options.lock_fd = lock.fd();
  options.max_memory_bytes = options_.max_memory_bytes;
  options.max_time = options_.max_time;

  const ServerPaths paths = PathsOf(options_, folder);
  bool cancelled = false;
  bool superseded = false;
  double furthest = 0;
  absl::Time told = absl::InfinitePast();
  const auto wish = [&](const JobProgress& progress) {
    furthest = std::max(furthest, progress.fraction);
    if (stopping_) return Wish::kLeave;
    if (const absl::Time now = absl::Now(); now - told >= kReportInterval || now < told) {
      told = now;
      const auto asked_to_stop =
          store_->ReportProgress(attempt, progress.fraction, paths.WithoutPaths(progress.message));
      if (asked_to_stop.ok()) cancelled = *asked_to_stop;
      superseded =
          absl::IsAborted(asked_to_stop.status()) || absl::IsNotFound(asked_to_stop.status());
    }
    if (superseded) return Wish::kLeave;
    return cancelled ? Wish::kCancel : Wish::kGoOn;
  };
  auto end = engine_->Run(options, wish);
  if (superseded) {
    spdlog::warn("event=attempt_superseded job={} attempt={}", job.job_id, job.attempts);
    return;
  }
  if (!end.ok()) {
    JobProcessEnd not_started;
    not_started.failure = {end.status().code(), "PROCESS_NOT_STARTED",
                           std::string(end.status().message())};
    end = not_started;
    Pause(kFirstRetry);
  }
  if (cancelled && end->kind != JobProcessEnd::Kind::kDone) {
    Tell("cancel", [&] { return store_->MarkCancelled(attempt); });
    fs::remove_all(folder, error);
    spdlog::info("event=job_cancelled job={}", job.job_id);
    return;
  }
  Conclude(job, *end, furthest > job.progress + 1e-6, folder);
}

absl::StatusOr<std::vector<JobFile>> JobRunner::StoreResults(const std::string& folder) {
  std::vector<JobFile> results;
  std::error_code error;
  for (auto entry = fs::recursive_directory_iterator(folder, error);
       !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (entry->is_symlink(error) || !entry->is_regular_file(error)) continue;
    if (results.size() >= kMostResults) {
      return absl::ResourceExhaustedError(
          absl::StrCat("the job made more than ", kMostResults, " files"));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto added, artefacts_->AddFile(entry->path().string()));
    results.push_back({entry->path().lexically_relative(folder).generic_string(), added.digest,
                       added.size_bytes});
  }
  if (error) return absl::InternalError(absl::StrCat("results: ", error.message()));
  if (results.empty()) return absl::InternalError("the job ended without any result");
  std::sort(results.begin(), results.end(),
            [](const JobFile& a, const JobFile& b) { return a.name < b.name; });
  return results;
}

void JobRunner::Conclude(const PlanningJob& job, const JobProcessEnd& end, bool advanced,
                         const std::string& folder) {
  using Kind = JobProcessEnd::Kind;
  const Attempt attempt{job.job_id, job.attempts};
  const auto requeue = [&](bool crashed) {
    Tell("requeue", [&] { return store_->Requeue(attempt, crashed, advanced); });
  };
  const auto fail = [&](const JobFailure& failure) {
    JobFailure shown = failure;
    shown.message =
        WithFieldNames(job.kind, PathsOf(options_, folder).WithoutPaths(failure.message));
    Tell("fail", [&] { return store_->Fail(attempt, shown); });
    std::error_code ignored;
    fs::remove_all(folder, ignored);
    spdlog::info("event=job_failed job={} code={} reason={} message=\"{}\"", job.job_id,
                 absl::StatusCodeToString(failure.code), failure.reason, failure.message);
  };
  if (end.kind == Kind::kDone) {
    auto results = StoreResults(folder + "/out");
    if (results.ok()) {
      Tell("succeed", [&] { return store_->Succeed(attempt, *results); });
      std::error_code ignored;
      fs::remove_all(folder, ignored);
      spdlog::info("event=job_succeeded job={} results={}", job.job_id, results->size());
      return;
    }
    if (!artefacts_->HasRoom() || ErrorReason(results.status()) == "DISK_FULL") {
      return requeue(/*crashed=*/false);
    }
    return fail({results.status().code(), ErrorReason(results.status()),
                 std::string(results.status().message())});
  }
  if (end.kind == Kind::kStopped) return requeue(/*crashed=*/false);
  if (end.kind == Kind::kOutOfMemory) {
    return fail({absl::StatusCode::kResourceExhausted, "OUT_OF_MEMORY",
                 absl::StrCat("the job needed more than its ", options_.max_memory_bytes,
                              " bytes of memory")});
  }
  if (end.kind == Kind::kOutOfTime) {
    return fail(
        {absl::StatusCode::kDeadlineExceeded, "JOB_TIME_LIMIT",
         absl::StrCat("the job was not done within ", absl::FormatDuration(options_.max_time))});
  }
  // Without disk space no job can succeed, so its stated reason does not count.
  if (!artefacts_->HasRoom()) return requeue(/*crashed=*/false);
  const bool is_passing = IsPassing(end.failure.code) || RanOutOfDisk(end.failure);
  if (end.kind == Kind::kWithoutWord || is_passing) {
    const bool from_outside = end.was_killed || is_passing;
    if (advanced || job.crashes + 1 < (from_outside ? kMostKills : kMostCrashes)) {
      spdlog::warn("event=attempt_ended job={} attempt={} why=\"{}\"", job.job_id, job.attempts,
                   end.failure.message);
      return requeue(/*crashed=*/true);
    }
  }
  fail(end.failure);
}

}  // namespace sightline
