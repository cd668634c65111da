// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/engine/subprocess.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "core/process/start_process.h"

namespace sightline {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kMostBytes = size_t{64} << 20;
constexpr int kPoll_ms = 100;

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

// What comes until both pipes are closed. False: too much, or too late.
bool ReadAll(const Pipe& output, const Pipe& errors, Clock::time_point end,
             SubprocessResult* result) {
  std::array<pollfd, 2> fds = {pollfd{output.ends[0], POLLIN, 0},
                               pollfd{errors.ends[0], POLLIN, 0}};
  const std::array<std::string*, 2> texts = {&result->output, &result->errors};
  std::array<char, 8192> buffer;
  while (fds[0].fd >= 0 || fds[1].fd >= 0) {
    if (Clock::now() > end) return false;
    if (poll(fds.data(), fds.size(), kPoll_ms) < 0 && errno != EINTR) return false;
    for (size_t i = 0; i < fds.size(); ++i) {
      if (fds[i].fd < 0 || fds[i].revents == 0) continue;
      const ssize_t got = read(fds[i].fd, buffer.data(), buffer.size());
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) {
        fds[i].fd = -1;
        continue;
      }
      texts[i]->append(buffer.data(), static_cast<size_t>(got));
      if (texts[i]->size() > kMostBytes) return false;
    }
  }
  return true;
}

}  // namespace

absl::StatusOr<SubprocessResult> RunSubprocess(const std::vector<std::string>& words,
                                               absl::Duration timeout) {
  Pipe output, errors;
  if (!output.Open() || !errors.Open()) {
    return absl::UnavailableError(absl::StrCat("cannot make a pipe: ", std::strerror(errno)));
  }
  const absl::StatusOr<pid_t> started =
      StartProcess({.words = words,
                    .in_path = true,
                    .descriptors = {{.number = 1, .ours = output.ends[1]},
                                    {.number = 2, .ours = errors.ends[1]}}});
  if (!started.ok()) return started.status();
  const pid_t pid = *started;
  output.CloseWriteEnd();
  errors.CloseWriteEnd();
  SubprocessResult result;
  const bool whole =
      ReadAll(output, errors, Clock::now() + absl::ToChronoNanoseconds(timeout), &result);
  if (!whole) kill(-pid, SIGKILL);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (!whole) {
    return absl::UnavailableError(absl::StrCat(
        words[0], " did not answer within ", absl::FormatDuration(timeout), ", or said too much"));
  }
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  return result;
}

}  // namespace sightline
