// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/job_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/process/start_process.h"
#include "core/status/status_macros.h"
#include "planning_service/execution/process_memory.h"

namespace sightline {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kPoll_ms = 100;
constexpr auto kMemoryInterval = std::chrono::seconds(1);
constexpr auto kStopTime = std::chrono::seconds(5);
// Descriptors of the child.
constexpr int kLifelineFd = 3;
constexpr int kLockFd = 4;

class ScopedFd {
 public:
  explicit ScopedFd(int fd = -1) : fd_(fd) {}
  ~ScopedFd() { Reset(); }
  ScopedFd(const ScopedFd&) = delete;
  ScopedFd& operator=(const ScopedFd&) = delete;
  int get() const { return fd_; }
  void Reset(int fd = -1) {
    if (fd_ >= 0) close(fd_);
    fd_ = fd;
  }

 private:
  int fd_;
};

bool MakePipe(ScopedFd* read_end, ScopedFd* write_end) {
  int fds[2];
  if (pipe2(fds, O_CLOEXEC) != 0) return false;
  read_end->Reset(fds[0]);
  write_end->Reset(fds[1]);
  return true;
}

std::string DescribeEnd(int wait_status, const std::string& last_words) {
  const std::string how = WIFSIGNALED(wait_status)
                              ? absl::StrCat("was killed by signal ", WTERMSIG(wait_status), " (",
                                             strsignal(WTERMSIG(wait_status)), ")")
                              : absl::StrCat("ended with exit code ", WEXITSTATUS(wait_status));
  return absl::StrCat("the process of the job ", how,
                      last_words.empty() ? "" : absl::StrCat("; its last words: ", last_words));
}

class ChildProcess {
 public:
  absl::Status Start(const JobProcessOptions& options) {
    ScopedFd lifeline_read, output_write;
    if (!MakePipe(&lifeline_read, &lifeline_) || !MakePipe(&output_, &output_write)) {
      return absl::UnavailableError(absl::StrCat("cannot make a pipe: ", std::strerror(errno)));
    }
    ProcessStart start = {
        .words = {options.program, "--progress=json", absl::StrCat("--parent-fd=", kLifelineFd)},
        .folder = options.folder,
        .descriptors = {{.number = 1, .file = "/dev/null", .flags = O_WRONLY},
                        {.number = 2, .ours = output_write.get()},
                        {.number = kLifelineFd, .ours = lifeline_read.get()}}};
    start.words.insert(start.words.end(), options.arguments.begin(), options.arguments.end());
    if (options.lock_fd >= 0) {
      start.descriptors.push_back({.number = kLockFd, .ours = options.lock_fd});
    }
    if (!options.temporary_folder.empty()) {
      if (mkdir(options.temporary_folder.c_str(), 0700) != 0 && errno != EEXIST) {
        return absl::UnavailableError(
            absl::StrCat(options.temporary_folder, ": cannot be made: ", std::strerror(errno)));
      }
      start.environment.push_back(absl::StrCat("TMPDIR=", options.temporary_folder));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(pid_, StartProcess(start));
    return absl::OkStatus();
  }

  ~ChildProcess() {
    if (pid_ <= 0) return;
    Kill();
    int ignored;
    waitpid(pid_, &ignored, 0);
  }

  pid_t pid() const { return pid_; }
  void AskToStop() const { kill(pid_, SIGTERM); }
  // The servers of the process end too, because the other end of their pipe is closed.
  void Kill() const { kill(-pid_, SIGKILL); }

  enum class Heard { kWords, kNothing, kEnd };
  // Waits up to kPoll_ms for messages of the process and reads them.
  Heard Listen(CommandMessages* words) {
    pollfd fd = {output_.get(), POLLIN, 0};
    if (poll(&fd, 1, kPoll_ms) <= 0) return Heard::kNothing;
    char buffer[4096];
    const ssize_t got = read(output_.get(), buffer, sizeof(buffer));
    if (got < 0 && errno == EINTR) return Heard::kNothing;
    if (got <= 0) return Heard::kEnd;
    words->Add(buffer, static_cast<size_t>(got));
    return Heard::kWords;
  }

  // True once the process has ended.
  bool Ended(int* wait_status) {
    const pid_t ended = waitpid(pid_, wait_status, WNOHANG);
    if (ended == 0 || (ended < 0 && errno == EINTR)) return false;
    // Ends children that the process has left behind.
    kill(-pid_, SIGKILL);
    pid_ = -1;
    return true;
  }

 private:
  pid_t pid_ = -1;
  ScopedFd lifeline_;  // the process ends when this is closed
  ScopedFd output_;
};

}  // namespace

absl::StatusOr<JobProcessEnd> RunJobProcess(const JobProcessOptions& options,
                                            const std::function<bool(const JobProgress&)>& go_on) {
  ChildProcess child;
  SIGHTLINE_RETURN_IF_ERROR(child.Start(options));
  const Clock::time_point start = Clock::now();
  Clock::time_point memory_looked_at = start;
  std::optional<JobProcessEnd::Kind> stopping;
  std::optional<Clock::time_point> asked_to_stop;
  CommandMessages words;
  int wait_status = 0;
  bool talks = true;
  while (!child.Ended(&wait_status)) {
    if (talks) {
      talks = child.Listen(&words) != ChildProcess::Heard::kEnd;
    } else {
      poll(nullptr, 0, kPoll_ms);
    }
    const Clock::time_point now = Clock::now();
    if (asked_to_stop) {
      if (now - *asked_to_stop > kStopTime) child.Kill();
      continue;
    }
    if (!go_on(words.progress())) {
      stopping = JobProcessEnd::Kind::kStopped;
      asked_to_stop = now;
      child.AskToStop();
    } else if (absl::FromChrono(now - start) > options.max_time) {
      stopping = JobProcessEnd::Kind::kOutOfTime;
      asked_to_stop = now;
      child.AskToStop();
    } else if (options.max_memory_bytes > 0 && now - memory_looked_at > kMemoryInterval) {
      memory_looked_at = now;
      if (ProcessTreeMemory(child.pid()) > options.max_memory_bytes) {
        stopping = JobProcessEnd::Kind::kOutOfMemory;
        asked_to_stop = now;
        child.Kill();
      }
    }
  }
  // The last messages are still in the pipe.
  while (talks && child.Listen(&words) == ChildProcess::Heard::kWords) {
  }
  JobProcessEnd end;
  const bool done = WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == 0;
  if (stopping) {
    end.kind = *stopping;
  } else if (done) {
    end.kind = JobProcessEnd::Kind::kDone;
  } else if (words.failure() && WIFEXITED(wait_status)) {
    end.kind = JobProcessEnd::Kind::kFailed;
    end.failure = *words.failure();
  } else {
    end.kind = JobProcessEnd::Kind::kWithoutWord;
    end.was_killed = WIFSIGNALED(wait_status) && WTERMSIG(wait_status) == SIGKILL;
    end.failure = {absl::StatusCode::kInternal, "PROCESS_ENDED",
                   DescribeEnd(wait_status, words.last_words())};
  }
  return end;
}

}  // namespace sightline
