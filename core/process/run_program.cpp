// SPDX-License-Identifier: Apache-2.0
#include "core/process/run_program.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <optional>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/process/process_clock.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

constexpr size_t kErrorsTailBytes = 2000;
// Pause between two checks whether a program that has closed its pipes has ended; the shortest wait
// for output.
constexpr absl::Duration kEndPoll = absl::Milliseconds(5);

struct Pipe {
  ~Pipe() {
    for (const int fd : ends) {
      if (fd >= 0) close(fd);
    }
  }
  bool Open() { return pipe2(ends.data(), O_CLOEXEC) == 0; }
  void CloseWriteEnd() {
    close(ends[1]);
    ends[1] = -1;
  }
  std::array<int, 2> ends = {-1, -1};
};

// Killed and waited for, unless it has ended.
class Child {
 public:
  Child(pid_t pid, bool leads_group) : pid_(pid), leads_group_(leads_group) {}
  ~Child() {
    if (pid_ <= 0) return;
    kill(leads_group_ ? -pid_ : pid_, SIGKILL);
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  // How it ended, as of waitpid(); nothing while it runs.
  std::optional<int> Ended() {
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) != pid_) return std::nullopt;
    pid_ = 0;
    return status;
  }

 private:
  pid_t pid_;
  const bool leads_group_;
};

// Reads until both pipes are closed.
absl::Status ReadAll(const Pipe& output, const Pipe& errors, const ProgramLimits& limits,
                     ProcessClock* clock, FinishedProgram* finished) {
  std::array<pollfd, 2> fds = {pollfd{output.ends[0], POLLIN, 0},
                               pollfd{errors.ends[0], POLLIN, 0}};
  const std::array<std::string*, 2> texts = {&finished->output, &finished->errors};
  std::string buffer(1 << 16, '\0');
  while (fds[0].fd >= 0 || fds[1].fd >= 0) {
    const absl::Duration left = limits.time_limit - clock->Look();
    if (left <= absl::ZeroDuration()) return absl::DeadlineExceededError("");
    const absl::Duration wait = std::clamp(left, kEndPoll, ProcessClock::kPeriod);
    const auto wait_ms = static_cast<int>(absl::ToInt64Milliseconds(wait));
    if (poll(fds.data(), fds.size(), wait_ms) < 0 && errno != EINTR) {
      return absl::UnavailableError(std::strerror(errno));
    }
    for (size_t i = 0; i < fds.size(); ++i) {
      if (fds[i].fd < 0 || fds[i].revents == 0) continue;
      const ssize_t got = read(fds[i].fd, buffer.data(), buffer.size());
      if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (got <= 0) {
        fds[i].fd = -1;
        continue;
      }
      texts[i]->append(buffer.data(), static_cast<size_t>(got));
    }
    if (finished->output.size() > limits.max_output_bytes) return absl::ResourceExhaustedError("");
    // Only the tail is kept: it says why the program failed.
    if (finished->errors.size() > 2 * kErrorsTailBytes) {
      finished->errors.erase(0, finished->errors.size() - kErrorsTailBytes);
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<FinishedProgram> RunProgram(ProcessStart start, const ProgramLimits& limits) {
  const std::string program = start.words.at(0);
  const absl::Status late = absl::DeadlineExceededError(absl::StrCat(
      program, " took longer than ", absl::FormatDuration(limits.time_limit), " and was ended"));
  Pipe output, errors;
  if (!output.Open() || !errors.Open()) {
    return absl::UnavailableError(absl::StrCat("cannot make a pipe: ", std::strerror(errno)));
  }
  start.descriptors.push_back({.number = 1, .ours = output.ends[1]});
  start.descriptors.push_back({.number = 2, .ours = errors.ends[1]});
  SIGHTLINE_ASSIGN_OR_RETURN(const pid_t started, StartProcess(start));
  Child child(started, !start.in_our_group);
  output.CloseWriteEnd();
  errors.CloseWriteEnd();

  ProcessClock clock(started);
  FinishedProgram finished;
  const absl::Status all = ReadAll(output, errors, limits, &clock, &finished);
  if (absl::IsDeadlineExceeded(all)) return late;
  if (absl::IsResourceExhausted(all)) {
    return absl::ResourceExhaustedError(absl::StrCat(
        program, " wrote more than ", limits.max_output_bytes >> 20, " MiB and was ended"));
  }
  if (!all.ok()) return all;
  std::optional<int> ended;
  while (!(ended = child.Ended())) {
    if (clock.Look() > limits.time_limit) return late;
    absl::SleepFor(kEndPoll);
  }
  finished.wait_status = *ended;
  return finished;
}

}  // namespace sightline
